// Bundles of web/dist. Each entry is one file that a browser takes as it is, but for the module, which leaves three to its user.
import { existsSync, statSync } from "node:fs";
import { resolve } from "node:path";
import { build } from "esbuild";

const MODULE = {
  format: "esm",
  external: ["three", "three/*", "react", "@react-three/fiber", "@gltf-transform/*", "node:*"],
  sourcemap: true,
};
const SCRIPT = { format: "iife", minify: true, legalComments: "none" };

// The viewer turns cameras with three.js and draws without it.
const WITHOUT_RENDERER = {
  name: "without-renderer",
  setup: (build) => build.onResolve({ filter: /^three$/ }, () => ({ path: resolve("src/viewer/three.js") })),
};

// What both renderers share comes from the three that the other one is in.
const WITHOUT_WEBGL = {
  name: "without-webgl",
  setup: (build) =>
    build.onResolve({ filter: /^three$/ }, ({ pluginData, resolveDir }) =>
      pluginData ? undefined : build.resolve("three/webgpu", { resolveDir, kind: "import-statement", pluginData: true }),
    ),
};

// Entries beside the module share its classes.
const BESIDE_MODULE = {
  name: "beside-module",
  setup: (build) => build.onResolve({ filter: /^\.\/index\.js$/ }, () => ({ path: "./translucent-three.js", external: true })),
};

const BUNDLES = [
  { entry: "src/index.ts", out: "dist/translucent-three.js", ...MODULE },
  { entry: "src/webgpu.ts", out: "dist/webgpu.js", ...MODULE, plugins: [WITHOUT_WEBGL] },
  { entry: "src/react.ts", out: "dist/react.js", ...MODULE, plugins: [BESIDE_MODULE] },
  { entry: "src/gltf-transform.ts", out: "dist/gltf-transform.js", ...MODULE },
  // For classic scripts and pages from disk: everything, three included, as the global `translucentThree`.
  { entry: "src/browser.ts", out: "dist/translucent-three.browser.js", globalName: "translucentThree", ...SCRIPT },
  { entry: "src/webgpu.browser.ts", out: "dist/webgpu.browser.js", globalName: "translucentThree", ...SCRIPT, plugins: [WITHOUT_WEBGL] },
  { entry: "examples/glb/main.ts", out: "dist/example-glb.js", ...SCRIPT },
  { entry: "examples/react/main.jsx", out: "dist/example-react.js", ...SCRIPT, jsx: "automatic", define: { "process.env.NODE_ENV": '"production"' } },
  // The page of `translucent page`.
  { entry: "page/main.js", out: "dist/page.js", ...SCRIPT, plugins: [WITHOUT_RENDERER] },
  // The widget of `tl.view`.
  { entry: "notebook/widget.js", out: "dist/widget.js", ...SCRIPT, format: "esm", plugins: [WITHOUT_RENDERER] },
];

// With --package, what is on npm alone.
const packaged = process.argv.includes("--package");

for (const { entry, out, ...options } of BUNDLES) {
  if (!existsSync(entry) || (packaged && !options.external)) continue;
  await build({ entryPoints: [entry], outfile: out, bundle: true, target: "es2022", logLevel: "warning", ...options });
  console.log(`web/${out} ${Math.round(statSync(out).size / 1000)} kB`);
}
