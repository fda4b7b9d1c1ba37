/**
 * One .glb with the light that comes through it. After `make web`, `npx serve web`, and there examples/glb/; another model:
 * ?model=URL. What the file has as KHR_materials_volume is kept; a file without gets a color of wine.
 */
import { Box3, Color, Mesh, MeshPhysicalMaterial, PMREMGenerator, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { NeutralToneMapping } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { ExactThicknessPass, TranslucentMaterial } from "../../src/index.js";

const told = document.getElementById("told")!;

async function main(): Promise<void> {
  const renderer = new WebGLRenderer({ antialias: true });
  renderer.toneMapping = NeutralToneMapping;
  document.body.appendChild(renderer.domElement);
  const scene = new Scene();
  scene.environment = new PMREMGenerator(renderer).fromScene(new RoomEnvironment(), 0.02).texture;
  scene.background = scene.environment;
  scene.backgroundBlurriness = 0.3;
  const camera = new PerspectiveCamera(40, 1, 0.01, 100);
  const controls = new OrbitControls(camera, renderer.domElement);
  const pass = new ExactThicknessPass(renderer);

  const model = new URLSearchParams(location.search).get("model") ?? "../../dist/knot.glb";
  const { scene: loaded } = await new GLTFLoader().loadAsync(model);
  const box = new Box3().setFromObject(loaded);
  const size = box.getSize(new Vector3()).length();
  loaded.traverse((object) => {
    if (object instanceof Mesh) object.material = translucent(object.material as MeshPhysicalMaterial, pass, size);
  });
  scene.add(loaded);
  box.getCenter(controls.target);
  camera.position.set(0.5, 0.35, 1).multiplyScalar(size).add(controls.target);
  camera.near = size / 100;
  camera.far = size * 100;

  const draw = (): void => {
    pass.render(scene, camera);
    renderer.render(scene, camera);
  };
  const resize = (): void => {
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setSize(innerWidth, innerHeight);
    camera.aspect = innerWidth / innerHeight;
    camera.updateProjectionMatrix();
    draw();
  };
  controls.addEventListener("change", draw);
  renderer.domElement.addEventListener("webglcontextrestored", draw);
  addEventListener("resize", resize);
  renderer.domElement.addEventListener("click", (event) => {
    const ratio = renderer.getPixelRatio();
    const metres = pass.at(event.offsetX * ratio, event.offsetY * ratio);
    told.textContent = metres === null ? "no number to trust here" : `${(1000 * metres).toFixed(2)} mm of it here`;
  });
  controls.update();
  resize();
  told.textContent = `${pass.precision}; drag to turn, click to measure`;
}

/** What the file says of its volume, with the light that really crosses it. */
function translucent(given: MeshPhysicalMaterial, pass: ExactThicknessPass, size: number): TranslucentMaterial {
  const volume = given.transmission > 0 && Number.isFinite(given.attenuationDistance);
  return new TranslucentMaterial({
    pass,
    ior: given.ior ?? 1.33,
    roughness: volume ? given.roughness : 0,
    attenuationColor: volume ? given.attenuationColor : new Color("#7b1e3a"),
    attenuationDistance: volume ? given.attenuationDistance : 0.15 * size,
  });
}

main().catch((error: Error) => {
  told.textContent = error.message;
  console.error(error);
});
