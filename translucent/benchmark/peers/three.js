// A scene of the benchmark by three.js: MeshPhysicalMaterial as GLTFLoader makes it of KHR_materials_transmission, volume and
// ior; the environment filtered by PMREM, and as the background; no tone mapping; 16 samples of each pixel (4 x 4 times as many
// pixels, averaged outside); transmission at full resolution; shadow maps of 2048.
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";
import { timedPicture } from "./pixels.js";

const PARTS = 4;
const renderer = new THREE.WebGLRenderer({ canvas: document.getElementById("canvas"), antialias: false });
renderer.toneMapping = THREE.NoToneMapping;
renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
renderer.shadowMap.enabled = true;
renderer.shadowMap.type = THREE.PCFShadowMap;
renderer.transmissionResolutionScale = 1;

window.deviceName = () => {
  const gl = renderer.getContext(), info = gl.getExtension("WEBGL_debug_renderer_info");
  return gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
};

window.drawScene = async ({ home, size }) => {
  const told = await (await fetch(home + "scene.json")).json();
  const gltf = await new GLTFLoader().loadAsync(home + "scene.glb?" + told.name);
  const map = await new EXRLoader().setDataType(THREE.FloatType).loadAsync(home + "environment.exr?" + told.name);
  map.mapping = THREE.EquirectangularReflectionMapping;
  map.minFilter = map.magFilter = THREE.LinearFilter;
  const scene = new THREE.Scene();
  scene.add(gltf.scene);
  // The middle of the picture is -z in the file, and +x here.
  scene.environment = scene.background = map;
  scene.environmentRotation.set(0, Math.PI / 2, 0);
  scene.backgroundRotation.set(0, Math.PI / 2, 0);
  const box = new THREE.Box3().setFromObject(gltf.scene), reach = box.getSize(new THREE.Vector3()).length();
  gltf.scene.traverse((item) => {
    if (item.isDirectionalLight) {
      item.castShadow = true;
      item.shadow.mapSize.set(2048, 2048);
      const ahead = item.target.getWorldPosition(new THREE.Vector3()).sub(item.getWorldPosition(new THREE.Vector3()));
      const middle = box.getCenter(new THREE.Vector3());
      item.position.copy(middle).addScaledVector(ahead.normalize(), -reach);
      item.target.position.set(0, 0, -1);
      Object.assign(item.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0, far: 2 * reach });
    }
    if (item.isMesh) item.castShadow = item.receiveShadow = true;
  });
  const camera = gltf.cameras[0];
  const side = PARTS * size;
  renderer.setSize(side, side, false);
  const picture = timedPicture(THREE, renderer, side, () => renderer.render(scene, camera));
  map.dispose();
  gltf.scene.traverse((item) => item.geometry?.dispose());
  return picture;
};
