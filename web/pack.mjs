// Before `npm pack` and `npm publish`: bundles and types of what is there now. Needs the shaders and nodes of `make web`.
import { spawnSync } from "node:child_process";
import { existsSync, readFileSync, rmSync } from "node:fs";

if (!existsSync("src/generated/shaders.ts")) {
  console.error("npm pack; src/generated/shaders.ts is not there; run `make web` in the checkout: it writes the shaders for three.js");
  process.exit(1);
}
rmSync("dist/types", { recursive: true, force: true });
for (const command of [["build.mjs", "--package"], ["node_modules/typescript/bin/tsc", "-p", "."]]) {
  const { status } = spawnSync(process.execPath, command, { stdio: ["ignore", "inherit", "inherit"] });
  if (status !== 0) process.exit(status ?? 1);
}
const { files, repository, homepage, bugs } = JSON.parse(readFileSync("package.json", "utf8"));
for (const file of files) {
  if (!file.includes("*") && !existsSync(file)) {
    console.error(`npm pack; ${file} was not built; see the messages above`);
    process.exit(1);
  }
}
const absent = Object.entries({ repository, homepage, bugs }).filter(([, value]) => !value).map(([name]) => name);
if (absent.length) console.error(`npm pack; package.json names no ${absent.join(", ")}; add the address of the project before you publish`);
