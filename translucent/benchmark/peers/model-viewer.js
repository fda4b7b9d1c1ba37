// A scene of the benchmark by <model-viewer>: its own loader, materials and environment, read as float before its canvas would
// clamp and encode it; the .hdr as environment and skybox; no tone mapping; no shadow of its own; the camera of the scene.
import * as THREE from "three";
import "@google/model-viewer";
import { timedPicture } from "./pixels.js";

const PARTS = 4;
const element = document.createElement("model-viewer");
Object.assign(element.style, { width: "512px", height: "512px" });
document.body.append(element);
const hidden = (name) => {
  for (let kind = element; kind; kind = Object.getPrototypeOf(kind))
    for (const symbol of Object.getOwnPropertySymbols(kind)) if (symbol.description === name) return element[symbol];
  throw Error(`model-viewer has no ${name}`);
};

window.deviceName = () => {
  const gl = hidden("renderer").threeRenderer.getContext(), info = gl.getExtension("WEBGL_debug_renderer_info");
  return gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
};

window.drawScene = async ({ home, size }) => {
  const told = await (await fetch(home + "scene.json")).json();
  const loaded = new Promise((done, failed) => {
    element.addEventListener("load", done, { once: true });
    element.addEventListener("error", (event) => failed(Error(JSON.stringify(event.detail))), { once: true });
  });
  const lit = new Promise((done) => element.addEventListener("environment-change", done, { once: true }));
  const attributes = { "tone-mapping": "none", exposure: "1", "shadow-intensity": "0", "interaction-prompt": "none", loading: "eager" };
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.setAttribute("environment-image", `${home}environment.hdr?${told.name}.hdr`);
  element.setAttribute("skybox-image", `${home}environment.hdr?${told.name}.hdr`);
  element.setAttribute("src", `${home}scene.glb?${told.name}`);
  await Promise.all([loaded, lit]);
  const scene = hidden("scene"), renderer = hidden("renderer").threeRenderer;
  // The middle of the picture is -z in the file, and +x here, as if the model were turned.
  scene.environmentRotation.set(0, Math.PI / 2, 0);
  scene.backgroundRotation.set(0, Math.PI / 2, 0);
  // It turns and centers the model: the camera goes with it.
  const model = scene.model ?? scene.target.children[0];
  model.updateWorldMatrix(true, false);
  const { eye, right, up, forward, fov_y_degrees: angle } = told.camera;
  const away = 10 * Math.hypot(...eye) + 1e-6, camera = new THREE.PerspectiveCamera(angle, 1, away * 1e-4, away);
  const pose = new THREE.Matrix4().makeBasis(
    new THREE.Vector3(...right), new THREE.Vector3(...up), new THREE.Vector3(...forward).negate());
  pose.setPosition(...eye).premultiply(model.matrixWorld);
  pose.decompose(camera.position, camera.quaternion, camera.scale);
  const side = PARTS * size;
  renderer.toneMapping = THREE.NoToneMapping;
  return timedPicture(THREE, renderer, side, () => {
    renderer.setViewport(0, 0, side, side);
    renderer.clear();
    renderer.render(scene, camera);
  });
};
