/** Everything in one script, with three.js and what loads and turns models: for pages that are opened from disk. */
export * as THREE from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
export * from "./index.js";
