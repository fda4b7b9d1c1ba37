// A scene of the benchmark by Babylon.js: PBRMaterial as its loader makes it of KHR_materials_transmission, volume and ior; the
// environment filtered in real time from .hdr and as the sky; no image processing; 16 samples of each pixel (4 x 4 times as many
// pixels, averaged outside).
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { HDRCubeTexture } from "@babylonjs/core/Materials/Textures/hdrCubeTexture.js";
import { RenderTargetTexture } from "@babylonjs/core/Materials/Textures/renderTargetTexture.js";
import { Texture } from "@babylonjs/core/Materials/Textures/texture.js";
import { Constants } from "@babylonjs/core/Engines/constants.js";
import { Scene } from "@babylonjs/core/scene.js";
import { LoadAssetContainerAsync } from "@babylonjs/core/Loading/sceneLoader.js";
import { ShadowGenerator } from "@babylonjs/core/Lights/Shadows/shadowGenerator.js";
import "@babylonjs/core/Lights/Shadows/shadowGeneratorSceneComponent.js";
import "@babylonjs/core/Helpers/sceneHelpers.js";
import "@babylonjs/core/Materials/PBR/pbrMaterial.js";
import "@babylonjs/core/Engines/Extensions/engine.readTexture.js";
import "@babylonjs/loaders/glTF/2.0/index.js";
import { topDown } from "./pixels.js";

const PARTS = 4;
const canvas = document.getElementById("canvas");
const engine = new Engine(canvas, false, { preserveDrawingBuffer: true });

window.deviceName = () => engine.getGlInfo().renderer;

const ready = (texture) => new Promise((done) => (texture.isReady() ? done() : texture.onLoadObservable.addOnce(done)));

window.drawScene = async ({ home, size }) => {
  const told = await (await fetch(home + "scene.json")).json();
  const side = PARTS * size;
  engine.setSize(side, side);
  const scene = new Scene(engine);
  scene.useRightHandedSystem = true; // as glTF
  scene.imageProcessingConfiguration.applyByPostProcess = true; // materials leave linear radiance, and nothing processes it
  const map = new HDRCubeTexture(home + "environment.hdr?" + told.name, scene, 256, false, true, false, true);
  await ready(map);
  scene.environmentTexture = map;
  const container = await LoadAssetContainerAsync(home + "scene.glb?" + told.name, scene);
  container.addAllToScene();
  scene.activeCamera = container.cameras[0];
  const sky = scene.createDefaultSkybox(map, true, scene.activeCamera.maxZ * 0.9, 0, false);
  sky.material.imageProcessingConfiguration = scene.imageProcessingConfiguration;
  for (const mesh of container.meshes) mesh.renderingGroupId = 1; // after the sky, which would hide a thin plate
  for (const light of container.lights) {
    if (light.getTypeID() !== 1) continue;
    const shadows = new ShadowGenerator(2048, light);
    shadows.usePercentageCloserFiltering = true;
    shadows.bias = 2e-3;
    shadows.normalBias = 0.01;
    light.autoCalcShadowZBounds = true;
    for (const mesh of container.meshes) {
      shadows.addShadowCaster(mesh);
      mesh.receiveShadows = true;
    }
  }
  const target = new RenderTargetTexture("picture", side, scene, false, true, Constants.TEXTURETYPE_FLOAT);
  target.renderList = null;
  target.useCameraPostProcesses = false;
  target.activeCamera = scene.activeCamera;
  scene.customRenderTargets.push(target);
  await scene.whenReadyAsync();
  let pixels;
  const draw = async () => {
    scene.render();
    pixels = await target.readPixels();
  };
  await draw();
  await draw();
  const begin = performance.now();
  await draw();
  const seconds = (performance.now() - begin) / 1000;
  const found = topDown(pixels, side);
  scene.dispose();
  return { pixels: found, seconds };
};
