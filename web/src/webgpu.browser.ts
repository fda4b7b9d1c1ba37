/** The same in one script, with three.js: for pages that are opened from disk. */
export * as THREE from "three/webgpu";
export * as TSL from "three/tsl";
export * from "./webgpu.js";
