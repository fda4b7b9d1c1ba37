// A scene of the benchmark by Filament for the web: gltfio's materials of KHR_materials_transmission, volume and ior, refraction
// in screen space; the environment filtered here as cmgen does (GGX, 32 directions, levels by roughness), and as the sky; a
// linear tone curve; 16 samples of each pixel. Its canvas has 8 bits, for radiance up to 4.
// It paces frames by itself, so that the time of a call is not that of a picture: none is told. Bodies that transmit show no
// reflections of the environment here, whatever is in its cube; other surfaces do.
import { topDown } from "./pixels.js";

const PARTS = 4, FACE = 64, LEVELS = 4, RAYS = 32, BRIGHTEST = 4;
const load = (path) => new Promise((done) => {
  const script = document.createElement("script");
  Object.assign(script, { src: path, onload: done });
  document.head.append(script);
});
await load("/npm/gl-matrix/gl-matrix-min.js");
Object.assign(window, window.glMatrix);
await load("/npm/filament/filament.js");
await new Promise((done) => Filament.init([], done));
const canvas = document.getElementById("canvas");
canvas.width = canvas.height = 512;
const engine = Filament.Engine.create(canvas, { antialias: false, preserveDrawingBuffer: true });
const gl = canvas.getContext("webgl2");
const chain = engine.createSwapChain(), renderer = engine.createRenderer();

window.deviceName = () => {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  return gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
};

// Radiance of a .hdr without compression in a direction, between its pixels.
function skyOf(bytes) {
  const text = new TextDecoder("latin1").decode(bytes.subarray(0, 200)), [line, h, w] = text.match(/-Y (\d+) \+X (\d+)\n/);
  const first = text.indexOf(line) + line.length, data = new Float32Array(3 * h * w);
  for (let i = 0; i < h * w; i++)
    for (let c = 0; c < 3; c++) data[3 * i + c] = (bytes[first + 4 * i + c] + 0.5) * 2 ** (bytes[first + 4 * i + 3] - 136);
  return ([x, y, z]) => {
    const u = (Math.atan2(x, -z) / (2 * Math.PI) + 0.5) * w - 0.5;
    const v = Math.min(Math.max((Math.acos(Math.min(Math.max(y, -1), 1)) / Math.PI) * h - 0.5, 0), h - 1);
    const i = Math.floor(u), j = Math.min(Math.floor(v), h - 2), s = u - i, t = v - j;
    const at = (a, b, c) => data[3 * ((j + b) * w + ((i + a + +w) % w)) + c];
    return [0, 1, 2].map((c) => (1 - t) * ((1 - s) * at(0, 0, c) + s * at(1, 0, c)) + t * ((1 - s) * at(0, 1, c) + s * at(1, 1, c)));
  };
}

const AXES = [(s, t) => [1, -t, -s], (s, t) => [-1, -t, s], (s, t) => [s, 1, t], (s, t) => [s, -1, -t], (s, t) => [s, -t, 1], (s, t) => [-s, -t, -1]];
const unit = (v) => v.map((x) => x / Math.hypot(...v));

// Mean over GGX's lobe about a normal that is the direction of view, weighted by the cosine (Karis 2013).
function lobe(sky, n, alpha) {
  if (alpha === 0) return sky(n);
  const side = unit(Math.abs(n[1]) < 0.9 ? [n[2], 0, -n[0]] : [0, -n[2], n[1]]);
  const other = [n[1] * side[2] - n[2] * side[1], n[2] * side[0] - n[0] * side[2], n[0] * side[1] - n[1] * side[0]];
  const sum = [0, 0, 0];
  let weight = 0;
  for (let k = 0; k < RAYS; k++) {
    const e = (k + 0.5) / RAYS, turn = k * 2.399963, c2 = (1 - e) / (1 + (alpha * alpha - 1) * e), c = Math.sqrt(c2), s = Math.sqrt(1 - c2);
    const cosine = 2 * c2 - 1;
    if (cosine <= 0) continue;
    const a = 2 * c * s * Math.cos(turn), b = 2 * c * s * Math.sin(turn);
    const light = sky([0, 1, 2].map((i) => cosine * n[i] + a * side[i] + b * other[i]));
    for (let i = 0; i < 3; i++) sum[i] += cosine * light[i];
    weight += cosine;
  }
  return sum.map((x) => x / weight);
}

function cubeOf(sky, levels, first) {
  const cube = Filament.Texture.Builder().width(first).height(first).levels(levels)
    .sampler(Filament.Texture$Sampler.SAMPLER_CUBEMAP).format(Filament.Texture$InternalFormat.RGBA16F).build(engine);
  for (let level = 0; level < levels; level++) {
    const n = first >> level, data = new Float32Array(24 * n * n), lod = level / Math.max(levels - 1, 1);
    const rough = 1 - Math.sqrt(1 - lod); // lod = r (2 - r)
    AXES.forEach((axis, f) => {
      for (let j = 0; j < n; j++)
        for (let i = 0; i < n; i++) {
          const d = unit(axis((2 * (i + 0.5)) / n - 1, (2 * (j + 0.5)) / n - 1));
          data.set([...lobe(sky, d, rough * rough), 1], 4 * ((f * n + j) * n + i));
        }
    });
    cube.setImageCube(engine, level, Filament.PixelBuffer(data, Filament.PixelDataFormat.RGBA, Filament.PixelDataType.FLOAT));
  }
  return cube;
}

// Irradiance over pi in spherical harmonics of three bands, with their constants, as Filament's shaders take it (Ramamoorthi 2001).
function harmonics(sky) {
  const sh = new Float32Array(27), rows = 64;
  const k = [0.282095, -0.488603, 0.488603, -0.488603, 1.092548, -1.092548, 0.315392, -1.092548, 0.546274];
  const band = [1, 2 / 3, 2 / 3, 2 / 3, 0.25, 0.25, 0.25, 0.25, 0.25];
  for (let j = 0; j < rows; j++)
    for (let i = 0; i < 2 * rows; i++) {
      const a = (Math.PI * (j + 0.5)) / rows, b = (Math.PI * (i + 0.5)) / rows;
      const d = [Math.sin(a) * Math.sin(b), Math.cos(a), -Math.sin(a) * Math.cos(b)], [x, y, z] = d;
      const basis = [1, y, z, x, x * y, y * z, 3 * z * z - 1, z * x, x * x - y * y], light = sky(d);
      for (let m = 0; m < 9; m++)
        for (let c = 0; c < 3; c++) sh[3 * m + c] += light[c] * basis[m] * k[m] * k[m] * band[m] * Math.sin(a) * (Math.PI / rows) ** 2;
    }
  return sh;
}

window.drawScene = async ({ home, size }) => {
  const told = await (await fetch(home + "scene.json")).json(), side = PARTS * size;
  const bytes = async (name) => new Uint8Array(await (await fetch(`${home}${name}?${told.name}`)).arrayBuffer());
  const sky = skyOf(await bytes("environment.hdr"));
  const scene = engine.createScene(), view = engine.createView(), camera = engine.createCamera(Filament.EntityManager.get().create());
  scene.setIndirectLight(Filament.IndirectLight.Builder().reflections(cubeOf(sky, LEVELS, FACE)).irradianceSh(3, harmonics(sky)).intensity(1).build(engine));
  scene.setSkybox(Filament.Skybox.Builder().environment(cubeOf(sky, 1, 2 * FACE)).build(engine));
  const loader = engine.createAssetLoader(), asset = loader.createAsset(await bytes("scene.glb"));
  await new Promise((done) => asset.loadResources(done, null, home, 1));
  scene.addEntities(asset.getEntities());
  const { eye, forward, right, up, fov_y_degrees: angle } = told.camera;
  const away = 10 * Math.hypot(...eye);
  camera.setProjectionFov(angle, 1, away * 1e-4, away, Filament.Camera$Fov.VERTICAL);
  camera.setModelMatrix([...right, 0, ...up, 0, ...forward.map((x) => -x), 0, ...eye, 1]);
  view.setScene(scene);
  view.setCamera(camera);
  view.setViewport([0, 0, side, side]);
  view.setAntiAliasing(Filament.View$AntiAliasing.NONE);
  view.setColorGrading(Filament.ColorGrading.Builder().toneMapping(Filament.ColorGrading$ToneMapping.LINEAR).build(engine));
  camera.setExposure(1, 1.2, 100 / BRIGHTEST); // f-number, seconds, ISO: a factor of ISO / 100
  const found = new Uint8Array(4 * side * side);
  const draw = () => {
    renderer.render(chain, view);
    engine.execute();
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(0, 0, side, side, gl.RGBA, gl.UNSIGNED_BYTE, found);
  };
  for (let i = 0; i < 4; i++) draw();
  const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  const pixels = Float32Array.from(found, (v) => BRIGHTEST * linear(v / 255));
  loader.destroyAsset(asset);
  engine.destroyView(view);
  engine.destroyScene(scene);
  return { pixels: topDown(pixels, side), seconds: null };
};
