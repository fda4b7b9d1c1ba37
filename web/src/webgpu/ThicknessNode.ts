/** Exact thickness for three's WebGPURenderer: what ExactThicknessPass is for WebGLRenderer, as a node. */
import {
  Box3,
  DepthTexture,
  FloatType,
  HalfFloatType,
  NearestFilter,
  Node,
  NodeUpdateType,
  OrthographicCamera,
  QuadMesh,
  REVISION,
  RGBAFormat,
  RGFormat,
  RenderTarget,
  RendererUtils,
  Scene,
  Vector2,
  Vector3,
  Vector4,
} from "three/webgpu";
import type { Camera, Material, Mesh, NodeFrame, Object3D, Texture, WebGPURenderer } from "three/webgpu";
import { uniform } from "three/tsl";
import { StandIns, areSpectral, bends, setExtinction } from "../bodies.js";
import type { StandIn } from "../bodies.js";
import { TranslucentError } from "../errors.js";
import { COVERAGE_FLOOR, OPEN_WEIGHTS, ROUNDING } from "../generated/shaders.js";
import { checkOptions, checkView } from "../options.js";
import type { ThicknessOptions, ThicknessPixels } from "../options.js";
import { expectedCount, isCut, place, seesFrom } from "../placement.js";
import type { View } from "../placement.js";
import { isSoftware, refinementOf } from "../software.js";
import { isClosed } from "../topology.js";
import { bodyNodes, here, keyOf, last, nearest, opticalDepthOf, summing, thicknessOf } from "./programs.js";
import type { Nodes, Summed } from "./programs.js";

/** Numbers that paths are added up in: floats in one draw, or whole numbers of 28 bits in two. */
export type NodePrecision = "float32" | "fixed28";

export interface ThicknessNodeOptions extends ThicknessOptions {
  /** Precision of the sums. Default: float32 where the graphics card can add it up (`float32-blendable`), fixed28 elsewhere. */
  precision?: NodePrecision;
}

/** What a GPUDevice says of itself; browsers do not say all of it. */
interface Device {
  limits: { maxTextureDimension2D: number };
  adapterInfo?: { isFallbackAdapter?: boolean; vendor?: string; architecture?: string; description?: string };
}

/** Revision of three from which on it was tried. */
const OLDEST = 185;

const PRECISIONS: NodePrecision[] = ["float32", "fixed28"];

/**
 * Exact thickness of meshes along every view ray, as a node (TSL): metres (r), signed count (g), 1 if the number can be
 * trusted (b), 1 if a body is there (a), at the pixel that is drawn. Its passes run before each picture that a material
 * with this node is part of; `measure(renderer, scene, camera)` runs them without one.
 */
export class ThicknessNode extends Node {
  static get type(): string {
    return "ThicknessNode";
  }

  /** Options of the constructor; changes count from the next picture on. */
  options: ThicknessNodeOptions;
  /** Diagonal of the box around all bodies in the last picture, in metres. */
  readonly diagonal: Nodes = uniform(1);
  /** What the last picture has: optical depth of each channel, where rays leave, opaque surfaces; 1 or 0. */
  readonly has: { opticalDepth: Nodes; exits: Nodes; ends: Nodes } = { opticalDepth: uniform(0), exits: uniform(0), ends: uniform(0) };
  /** Pixels of the last picture. */
  readonly pixels: Nodes = uniform(new Vector2(1, 1));
  /** Numbers that paths were added up in; null before the first picture. */
  precision: NodePrecision | null = null;
  /** Pixels along each side of a pixel that faces were drawn into; null before the first picture. */
  refine: number | null = null;
  private readonly standIns = new StandIns(bodyNodes);
  private readonly targets = {
    sums: target(FloatType, RGFormat),
    low: target(HalfFloatType, RGBAFormat),
    spectral: target(FloatType, RGBAFormat),
    ends: target(FloatType, RGFormat, true),
    fineEnds: target(FloatType, RGFormat, true),
    last: target(FloatType, RGBAFormat, true),
    thickness: target(FloatType, RGBAFormat),
    opticalDepth: target(FloatType, RGBAFormat),
  };
  private readonly resolve = {
    frame_size: uniform(new Vector4()) as Nodes,
    ray_right: uniform(new Vector4()) as Nodes,
    ray_up: uniform(new Vector4()) as Nodes,
    ray_forward: uniform(new Vector4()) as Nodes,
    expected_count: uniform(new Vector2()) as Nodes,
    rounding: uniform(0) as Nodes,
    count_share: uniform(0) as Nodes,
    coverage_floor: uniform(0) as Nodes,
    range: uniform(1) as Nodes,
  };
  private readonly resolvers: Record<string, Material> = {};
  private readonly quad = new QuadMesh();
  private readonly stage = new Scene();
  // Any: the shaders place bodies themselves.
  private readonly eye = new OrthographicCamera();

  constructor(options: ThicknessNodeOptions = {}) {
    super("vec4");
    checkOptions(options, "ThicknessNode", PRECISIONS);
    if (parseInt(REVISION) < OLDEST) {
      throw new TranslucentError("ThicknessNode", `this is three r${REVISION}, whose nodes make other WGSL of it`, `use three 0.${OLDEST} or newer`);
    }
    this.options = options;
    this.updateBeforeType = NodeUpdateType.RENDER;
    this.stage.matrixWorldAutoUpdate = false;
    this.eye.matrixWorldAutoUpdate = false;
  }

  /** Metres, count, validity and coverage of each pixel; row 0 is the top one. */
  get texture(): Texture {
    return this.targets.thickness.texture;
  }

  /** Optical depth of each pixel per channel, where bodies are of several media. */
  get opticalDepth(): Texture {
    return this.targets.opticalDepth.texture;
  }

  /** Opaque surfaces: depth as a share of that of the media (r), 1 where there is one (g). */
  get ends(): Texture {
    return this.targets.ends.texture;
  }

  /** Last surface of bodies on each ray: its normal in the world (rgb), metres along the camera's axis (a); 0 where none is. */
  get exits(): Texture {
    return this.targets.last.texture;
  }

  override setup(): Nodes {
    return here(this.texture);
  }

  override updateBefore({ renderer, scene, camera }: NodeFrame): undefined {
    if (renderer && scene && camera) this.run(renderer as WebGPURenderer, scene, camera);
  }

  /** Measure what a camera sees of a scene, without drawing it. The renderer must be ready: `await renderer.init()`. */
  measure(renderer: WebGPURenderer, scene: Object3D, camera: Camera): void {
    if (scene.matrixWorldAutoUpdate) scene.updateMatrixWorld();
    if (camera.parent === null && camera.matrixWorldAutoUpdate) camera.updateMatrixWorld();
    this.run(renderer, scene, camera);
  }

  /** Pixels of the last picture, read back from the graphics card. */
  async read(renderer: WebGPURenderer): Promise<ThicknessPixels> {
    if (this.precision === null) {
      throw new TranslucentError("read()", "nothing is measured yet", "render a picture, or call measure(renderer, scene, camera), first");
    }
    const { width, height } = this.targets.thickness;
    const pixels = (await renderer.readRenderTargetPixelsAsync(this.targets.thickness, 0, 0, width, height)) as Float32Array;
    const row = 4 * 16 * Math.ceil(width / 16); // WebGPU copies rows of 256 bytes
    const found = {
      width,
      height,
      thickness: new Float32Array(width * height),
      count: new Float32Array(width * height),
      valid: new Uint8Array(width * height),
      covered: new Uint8Array(width * height),
    };
    for (let y = 0, i = 0; y < height; y++) {
      for (let x = 0, j = row * y; x < width; x++, i++, j += 4) {
        found.thickness[i] = pixels[j];
        found.count[i] = pixels[j + 1];
        found.valid[i] = pixels[j + 2];
        found.covered[i] = pixels[j + 3];
      }
    }
    return found;
  }

  /** Free all that is on the graphics card; the node may be used again. */
  override dispose(): void {
    this.standIns.dispose();
    for (const key of Object.keys(this.resolvers)) {
      this.resolvers[key].dispose();
      delete this.resolvers[key];
    }
    for (const one of Object.values(this.targets)) one.dispose();
    this.precision = this.refine = null;
    super.dispose();
  }

  private run(renderer: WebGPURenderer, scene: Object3D, camera: Camera): void {
    checkOptions(this.options, "ThicknessNode", PRECISIONS);
    const precision = this.choose(renderer);
    const [bodies, opaque] = this.standIns.sort(scene, camera, this.options);
    checkView({}, camera, [...bodies, ...opaque].map((one) => one.mesh));
    const [width, height] = this.size(renderer);
    const { device } = renderer.backend as { device?: Device };
    const software = isFallback(device?.adapterInfo);
    const most = device?.limits.maxTextureDimension2D ?? Infinity;
    const refine = refinementOf(this.options.refine, software, [width, height], most, "ThicknessNode");
    this.refine = refine;
    const fine = [width * refine, height * refine];
    const view = seesFrom(camera, width, height, 0);
    const media = new Box3();
    for (const one of bodies) {
      one.measure();
      media.union(one.worldBox);
    }
    for (const one of opaque) one.measure();
    const several = this.options.opticalDepth ?? "auto";
    const bending = this.options.exits ?? "auto";
    const spectral = several === "auto" ? areSpectral(bodies) : several;
    const exits = bending === "auto" ? bodies.some((one) => bends(one.mesh)) : bending;
    const low = precision === "fixed28";
    const fineEnds = opaque.length > 0 && refine > 1;
    const uses = { sums: true, thickness: true, low, spectral, opticalDepth: spectral, ends: opaque.length > 0, fineEnds, last: exits };
    const refined = new Set(["sums", "low", "spectral", "fineEnds"]);
    for (const [name, used] of Object.entries(uses)) {
      const [w, h] = !used ? [1, 1] : refined.has(name) ? fine : [width, height];
      this.targets[name as keyof typeof uses].setSize(w, h);
    }
    this.pixels.value.set(width, height);
    this.has.opticalDepth.value = Number(spectral);
    this.has.exits.value = Number(exits);
    this.has.ends.value = Number(uses.ends);
    const state = RendererUtils.resetRendererState(renderer, undefined as never);
    renderer.setClearColor(0, 0);
    try {
      this.draw(renderer, view, refine === 1 ? view : seesFrom(camera, fine[0], fine[1], 0), media, bodies, opaque, precision);
    } finally {
      RendererUtils.restoreRendererState(renderer, state);
    }
  }

  /** Draw all passes; the state of the renderer is that of a picture of its own. */
  private draw(
    renderer: WebGPURenderer,
    view: View,
    fine: View,
    media: Box3,
    bodies: StandIn[],
    opaque: StandIn[],
    precision: NodePrecision,
  ): void {
    const { targets, resolve } = this;
    const diagonal = media.isEmpty() ? 1 : Math.max(media.getSize(new Vector3()).length(), Number.MIN_VALUE);
    this.diagonal.value = diagonal;
    const range = view.range(media);
    const reversed = (renderer as { reversedDepthBuffer?: boolean }).reversedDepthBuffer === true;
    const refine = targets.sums.width / targets.thickness.width;
    const ending = (one: StandIn): Mesh => {
      const { material } = one.mesh;
      const { side } = Array.isArray(material) ? material[0] : material;
      return one.use(`end ${side} ${reversed} ${keyOf(one)}`, () => Object.assign(nearest(one, reversed), { side }));
    };
    const fill = (into: RenderTarget, ones: StandIn[], from: View, made: (one: StandIn) => Mesh): void => {
      for (const one of ones) place(one, from, range);
      this.fill(renderer, into, ones.map(made));
    };
    if (opaque.length) fill(targets.ends, opaque, view, ending);
    if (opaque.length && refine > 1) fill(targets.fineEnds, opaque, fine, ending);
    const expected = [0, 0];
    const sound = bodies.every((one) => isClosed(one.mesh.geometry));
    let open = 0;
    let longest = Number.MIN_VALUE;
    for (const one of bodies) {
      const closed = isClosed(one.mesh.geometry);
      const weight = closed || precision === "fixed28" ? 1 : OPEN_WEIGHTS[Math.min(open++, OPEN_WEIGHTS.length - 1)];
      const [least, most] = expectedCount(one, view);
      expected[0] += weight * least;
      expected[1] += weight * most;
      one.uniforms.count_weight.value = weight;
      one.uniforms.snapping_share.value = sound ? 1 / diagonal : 0;
      setExtinction(one, diagonal);
      // Rays count from the middle of a body, or from their start if that may be inside.
      longest = Math.max(longest, one.worldBox.getSize(new Vector3()).length() + (isCut(one, view) ? view.start : 0));
    }
    resolve.range.value = longest;
    const ends = opaque.length ? (refine > 1 ? targets.fineEnds : targets.ends).texture : null;
    const sum = (what: Summed) => (one: StandIn): Mesh =>
      one.use(`${what} ${ends !== null} ${refine > 1} ${keyOf(one)}`, () => summing(one, what, ends, resolve.range));
    const high = precision === "fixed28" ? "high" : "path";
    fill(targets.sums, bodies, fine, sum(high));
    if (high === "high") fill(targets.low, bodies, fine, sum("low"));
    const spectral = this.has.opticalDepth.value > 0;
    if (spectral) fill(targets.spectral, bodies, fine, sum("spectral"));
    const leaving = (one: StandIn): Mesh => one.use(`exit ${reversed} ${keyOf(one)}`, () => last(one, reversed));
    if (this.has.exits.value > 0) fill(targets.last, bodies, view, leaving);

    resolve.frame_size.value.set(targets.thickness.width, targets.thickness.height, 0, 0);
    view.setRays(resolve.ray_right.value, resolve.ray_up.value, resolve.ray_forward.value);
    resolve.coverage_floor.value = COVERAGE_FLOOR * diagonal;
    resolve.expected_count.value.set(expected[0], expected[1]);
    resolve.rounding.value = ROUNDING * diagonal;
    resolve.count_share.value = diagonal;
    const low = high === "high" ? targets.low.texture : null;
    this.finish(renderer, targets.thickness, `${high} ${refine}`, () => thicknessOf(resolve, targets.sums.texture, low, refine));
    if (spectral) {
      const depth = (): Material => opticalDepthOf(resolve, targets.spectral.texture, this.texture, refine);
      this.finish(renderer, targets.opticalDepth, `spectral ${refine}`, depth);
    }
  }

  private choose(renderer: WebGPURenderer): NodePrecision {
    if ((renderer as { isWebGPURenderer?: boolean }).isWebGPURenderer !== true) {
      throw new TranslucentError("ThicknessNode", "the renderer is no WebGPURenderer", "use ExactThicknessPass with a WebGLRenderer");
    }
    if ((renderer.backend as { isWebGPUBackend?: boolean }).isWebGPUBackend !== true) {
      throw new TranslucentError(
        "ThicknessNode in this browser",
        "there is no WebGPU, and its renderer draws with WebGL2",
        "use ExactThicknessPass with a WebGLRenderer there",
      );
    }
    const precision = renderer.hasFeature("float32-blendable") ? (this.options.precision ?? "float32") : "fixed28";
    if (precision !== this.precision) {
      this.dispose();
      const [type, format] = precision === "float32" ? ([FloatType, RGFormat] as const) : ([HalfFloatType, RGBAFormat] as const);
      Object.assign(this.targets.sums.texture, { type, format });
      this.targets.spectral.texture.type = type;
      this.precision = precision;
    }
    return precision;
  }

  private size(renderer: WebGPURenderer): number[] {
    const target = renderer.getRenderTarget();
    const { x, y } = target ? { x: target.width, y: target.height } : renderer.getDrawingBufferSize(new Vector2());
    return (this.options.size ?? [x, y]).map((n) => Math.max(1, Math.floor(n)));
  }

  private fill(renderer: WebGPURenderer, into: RenderTarget, meshes: Mesh[]): void {
    renderer.setRenderTarget(into);
    this.stage.children = meshes; // none of them is anybody else's child
    renderer.render(this.stage, this.eye);
    this.stage.children = [];
  }

  private finish(renderer: WebGPURenderer, into: RenderTarget, key: string, make: () => Material): void {
    renderer.setRenderTarget(into);
    this.resolvers[key] ??= make();
    this.quad.material = this.resolvers[key] as never;
    this.quad.render(renderer);
  }
}

/** True if an adapter is one in software. */
const isFallback = (info: Device["adapterInfo"]): boolean =>
  info?.isFallbackAdapter === true || isSoftware(info?.vendor, info?.architecture, info?.description);

function target(type: typeof FloatType | typeof HalfFloatType, format: typeof RGFormat | typeof RGBAFormat, depth = false): RenderTarget {
  const filters = { minFilter: NearestFilter, magFilter: NearestFilter, generateMipmaps: false };
  const depthTexture = depth ? new DepthTexture(1, 1, FloatType) : null;
  return new RenderTarget(1, 1, { ...filters, type, format, depthBuffer: depth, depthTexture, stencilBuffer: false, samples: 0 });
}

/** Exact thickness at the pixel that is drawn: see ThicknessNode. */
export const thickness = (options: ThicknessNodeOptions = {}): ThicknessNode => new ThicknessNode(options);
