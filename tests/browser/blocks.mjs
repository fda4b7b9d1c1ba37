// Contents of a page's uniform blocks for cameras, as its viewer writes them: JSON on standard input and output.
import { readFileSync } from "node:fs";
import { fieldsOf, writeBlocks } from "../../web/src/viewer/blocks.js";
import { opened } from "../../web/src/viewer/container.js";
import { meshesOf } from "../../web/src/viewer/meshes.js";

const { file, cameras, size } = JSON.parse(readFileSync(0, "utf8"));
const page = await opened(readFileSync(file));
const meshes = meshesOf(page);
const variant = page.variants.base;
const answers = cameras.map((camera) => {
  const bytes = {}, blocks = {};
  for (const [name, section] of Object.entries(variant.blocks)) {
    bytes[name] = page.sections[section].slice().buffer;
    blocks[name] = fieldsOf(page.layout.blocks[name], bytes[name]);
  }
  const bodyBytes = variant.bodies.map((section) => page.sections[section].slice().buffer);
  const bodies = bodyBytes.map((buffer) => fieldsOf(page.layout.blocks.Body, buffer));
  writeBlocks({ scene: page.scene, meshes, variant, blocks, bodies, camera, size, shift: [0, 0], subpixel: 1 / 256 });
  const base64 = (buffer) => Buffer.from(buffer).toString("base64");
  return {
    blocks: Object.fromEntries(Object.entries(bytes).map(([name, buffer]) => [name, base64(buffer)])),
    bodies: bodyBytes.map(base64),
  };
});
console.log(JSON.stringify(answers));
