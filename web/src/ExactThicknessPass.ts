/** One unsorted, additive pass: metres of every ray inside bodies. shaders/thickness/signed_depth.frag is what it draws. */
import {
  Box3,
  FloatType,
  HalfFloatType,
  Mesh,
  NearestFilter,
  OrthographicCamera,
  Points,
  BufferGeometry,
  BufferAttribute,
  RGFormat,
  RedFormat,
  RGBAFormat,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderTarget,
} from "three";
import type { Camera, InstancedMesh, Material, Object3D, SkinnedMesh, Texture, WebGLRenderer } from "three";
import { StandIns, areSpectral, bends, setExtinction } from "./bodies.js";
import type { StandIn } from "./bodies.js";
import { TranslucentError } from "./errors.js";
import { checkOptions, checkView } from "./options.js";
import type { ThicknessOptions, ThicknessPixels } from "./options.js";
import { COVERAGE_FLOOR, NOTHING, OPEN_WEIGHTS, ROUNDING } from "./generated/shaders.js";
import { expectedCount, place, seesFrom } from "./placement.js";
import type { DepthRange, View } from "./placement.js";
import { CHECK_SHIFT, besideEdges, checkUniforms, checking, last, nearest, resolveUniforms, resolving, summing } from "./programs.js";
import type { Summing } from "./programs.js";
import { drawsInSoftware, refinementOf } from "./software.js";
import { isClosed } from "./topology.js";
import { bodyUniforms } from "./uniforms.js";

/** Numbers that paths are added up in. */
export type Precision = "float32" | "float16";

export interface ExactThicknessOptions extends ThicknessOptions {
  /** Precision of the sums. Default: float32 where the browser can add it up, float16 elsewhere. */
  precision?: Precision;
}

// Rounding of a sum in 16 bits: 11 bits of each number, over a handful of faces.
const ROUNDING_16 = 4e-3;
const LARGEST_16 = 65504;

/** Share of the diagonal by which a pixel beside an edge may be off before it is marked, in software. */
const WRONG = 1e-3;

/** All that decides what a picture shows, as a text. */
function pictureOf(view: View, all: StandIn[][], layout: string): string {
  const bodies = all.map((some) =>
    some.map(({ mesh }) => {
      const { geometry, morphTargetInfluences: morphs } = mesh;
      const versions = Object.values(geometry.attributes).map((one) => (one as BufferAttribute).version);
      const { instanceMatrix: instances, count } = mesh as InstancedMesh;
      const bones = (mesh as unknown as SkinnedMesh).skeleton?.boneMatrices;
      return [mesh.id, geometry.id, versions, geometry.index?.version, mesh.matrixWorld.elements, morphs, instances?.version, count, bones && [...bones]];
    }),
  );
  return JSON.stringify([layout, view.camera.projectionMatrix.elements, view.camera.matrixWorld.elements, bodies]);
}

/**
 * Exact thickness of meshes along every view ray, for a three.js scene.
 *
 * `render(scene, camera)` before the picture itself; `texture` then holds, for each pixel of the canvas: metres (r), signed
 * count (g), 1 if the number can be trusted (b), 1 if a body is there (a). Exact for closed meshes of any shape, in any
 * order, as deep as they overlap; other pixels are marked. Beside an edge b is 0.25 if a rasterizer in software may be off
 * by more than 0.1 % of the diagonal; see `settle`.
 */
export class ExactThicknessPass {
  /** Renderer that draws the pass. */
  readonly renderer: WebGLRenderer;
  /** Options of the constructor; changes count from the next `render` on. */
  options: ExactThicknessOptions;
  /** Diagonal of the box around all bodies at the last `render`, in metres. */
  diagonal = 1;
  private readonly standIns = new StandIns(bodyUniforms);
  private sums: WebGLRenderTarget | null = null;
  private last: WebGLRenderTarget | null = null;
  private ends: WebGLRenderTarget | null = null;
  private checks: WebGLRenderTarget | null = null;
  private readonly check = checkUniforms();
  private readonly points: Points<BufferGeometry, Material>;
  private result: WebGLRenderTarget | null = null;
  private readonly resolve = resolveUniforms();
  private readonly resolvers: Record<string, Material> = {};
  private readonly screen: Mesh;
  private readonly stage = new Scene();
  // Any: the shaders place bodies themselves. One of these knows reversed and logarithmic depth.
  private readonly eye = new OrthographicCamera();
  private layout = "";
  // What the last picture shows; the one whose edges are checked, or "".
  private picture = "";
  private checked = "";
  private settling: (() => void) | null = null;
  private software: boolean | null = null;

  constructor(renderer: WebGLRenderer, options: ExactThicknessOptions = {}) {
    if (!(renderer as { isWebGLRenderer?: boolean }).isWebGLRenderer) {
      throw new TranslucentError("ExactThicknessPass", "the renderer is no WebGLRenderer", "use three's WebGLRenderer, on WebGL2");
    }
    checkOptions(options, "ExactThicknessPass", ["float32", "float16"]);
    this.renderer = renderer;
    this.options = options;
    void this.precision; // refuses a renderer that can add up nothing
    this.stage.matrixWorldAutoUpdate = false;
    this.eye.matrixWorldAutoUpdate = false;
    const triangle = new BufferGeometry();
    triangle.setAttribute("position", new BufferAttribute(new Float32Array(9), 3));
    this.screen = new Mesh(triangle);
    this.points = new Points(new BufferGeometry(), besideEdges(this.check));
    this.screen.frustumCulled = this.points.frustumCulled = false;
  }

  /** Numbers that paths are added up in, on this machine; float16 has three digits. */
  get precision(): Precision {
    const { extensions } = this.renderer;
    const float = extensions.has("EXT_color_buffer_float");
    if (float && extensions.has("EXT_float_blend") && this.options.precision !== "float16") return "float32";
    if (float || extensions.has("EXT_color_buffer_half_float")) return "float16";
    throw new TranslucentError(
      "exact thickness in this browser",
      "it draws into no texture of floats (EXT_color_buffer_float, EXT_color_buffer_half_float)",
      "use another browser or graphics driver; show the bodies with three's own material meanwhile",
    );
  }

  /** Pixels along each side of a pixel that faces are drawn into: of the options, else 3 if this machine draws in software, and 1 if not. */
  get refine(): number {
    const { renderer } = this;
    this.software ??= drawsInSoftware(renderer.getContext() as WebGL2RenderingContext);
    return refinementOf(this.options.refine, this.software, this.size(), renderer.capabilities.maxTextureSize, "ExactThicknessPass");
  }

  /** Metres, count, validity and coverage of each pixel; null before the first `render`. */
  get texture(): Texture | null {
    return this.result?.textures[0] ?? null;
  }

  /** Optical depth of each pixel per channel, where bodies are of several media; else null. */
  get opticalDepth(): Texture | null {
    return this.result?.textures[1] ?? null;
  }

  /** Depth at which opaque surfaces end rays, in `refine` times as many pixels across: metres along the camera's axis are `near + length * r`; null where there are none. */
  get opaqueDepth(): Texture | null {
    return this.ends?.texture ?? null;
  }

  /** Last surface of bodies on each ray: its normal in the world (rgb), metres along the camera's axis (a); 0 where none is. */
  get exits(): Texture | null {
    return this.last?.texture ?? null;
  }

  /** Measure what a camera sees of a scene. False, with nothing drawn, while the context is lost. */
  render(scene: Object3D, camera: Camera): boolean {
    const { renderer } = this;
    const gl = renderer.getContext() as WebGL2RenderingContext;
    if (gl.isContextLost()) {
      this.checked = "";
      return false;
    }
    checkOptions(this.options, "ExactThicknessPass", ["float32", "float16"]);
    if (scene.matrixWorldAutoUpdate) scene.updateMatrixWorld();
    if (camera.parent === null && camera.matrixWorldAutoUpdate) camera.updateMatrixWorld();
    const [bodies, opaque] = this.standIns.sort(scene, camera, this.options);
    checkView(renderer, camera, [...bodies, ...opaque].map((one) => one.mesh));
    const [width, height] = this.size();
    const subpixel = 0.5 ** (gl.getParameter(gl.SUBPIXEL_BITS) as number);
    const { refine } = this;
    const view = seesFrom(camera, width, height, subpixel);
    const fine = seesFrom(camera, width * refine, height * refine, subpixel);
    const media = new Box3();
    for (const one of bodies) {
      one.measure();
      media.union(one.worldBox);
    }
    for (const one of opaque) one.measure();
    const several = this.options.opticalDepth ?? "auto";
    const spectral = several === "auto" ? areSpectral(bodies) : several;
    const bending = this.options.exits ?? "auto";
    const exits = bending === "auto" ? bodies.some((one) => bends(one.mesh)) : bending;
    this.prepare(width, height, refine, spectral, opaque.length > 0, exits);

    const diagonal = media.isEmpty() ? 1 : Math.max(media.getSize(new Vector3()).length(), Number.MIN_VALUE);
    this.diagonal = diagonal;
    const range = view.range(media);
    const saved = this.save();
    try {
      if (this.ends) this.draw(this.ends, this.placed(opaque, fine, range, (one) => this.ending(one, subpixel)), [this.nothing, 0, 0, 0]);
      const expected = [0, 0];
      const sound = bodies.every((one) => isClosed(one.mesh.geometry));
      let open = 0;
      const meshes = this.placed(bodies, fine, range, (one) => {
        const weight = isClosed(one.mesh.geometry) ? 1 : this.openWeight(open++);
        const [least, most] = expectedCount(one, view);
        expected[0] += weight * least;
        expected[1] += weight * most;
        const { uniforms } = one;
        uniforms.count_weight.value = weight;
        uniforms.snapping_share.value = sound && this.precision === "float32" ? 1 / diagonal : 0;
        uniforms.opaque_axial_depth.value = this.ends?.texture ?? null;
        setExtinction(one, diagonal);
        const blocked = this.ends !== null;
        const switches = { spectral, opaque: blocked, instanced: one.instanced !== null, subpixel };
        return one.use(`sum ${Object.values(switches)}`, () => summing(uniforms, switches));
      });
      this.draw(this.sums!, meshes, [0, 0, 0, 0]);
      if (this.last) this.leave(bodies);
      const picture = pictureOf(view, [bodies, opaque], this.layout);
      const still = this.picture === "" || this.picture === picture;
      if (this.checked !== picture) this.checked = "";
      this.picture = picture;
      this.settling = () => {
        const switches = { spectral: false, opaque: this.ends !== null, subpixel };
        if (this.checks && this.checked !== picture) this.checkEdges(bodies, view.rectangle(media), switches, diagonal);
        this.checked = picture;
        this.finish(view, media, spectral, diagonal, expected);
      };
      if (still || this.checked) this.settling();
      else this.finish(view, media, spectral, diagonal, expected);
    } finally {
      this.restore(saved);
    }
    return true;
  }

  /**
   * Mark the pixels of the last `render` in which the grid of a rasterizer in software decides which face is shown, and the
   * faces differ by more than 0.1 % of the diagonal. `render` does so itself in the first picture, and in each one that is
   * the same as the one before; `read` and `at` do so as well. On graphics cards, and with `refine: 1`, this does nothing.
   */
  settle(): void {
    if (!this.checks || this.checked || !this.settling) return;
    const saved = this.save();
    try {
      this.settling();
    } finally {
      this.restore(saved);
    }
  }

  /** Pixels of the last `render`, read back from the graphics card. */
  read(): ThicknessPixels {
    this.settle();
    if (!this.result) throw new TranslucentError("read()", "nothing is rendered yet", "call render(scene, camera) first");
    const { width, height } = this.result;
    const pixels = new Float32Array(4 * width * height);
    this.renderer.readRenderTargetPixels(this.result, 0, 0, width, height, pixels);
    const found = {
      width,
      height,
      thickness: new Float32Array(width * height),
      count: new Float32Array(width * height),
      valid: new Uint8Array(width * height),
      covered: new Uint8Array(width * height),
    };
    for (let y = 0, i = 0; y < height; y++) {
      for (let x = 0, j = 4 * width * (height - 1 - y); x < width; x++, i++, j += 4) {
        found.valid[i] = Math.floor(pixels[j + 2]);
        found.thickness[i] = found.valid[i] * pixels[j];
        found.count[i] = pixels[j + 1];
        found.covered[i] = pixels[j + 3];
      }
    }
    return found;
  }

  /** Metres inside bodies at a pixel of the last `render`, from the top left; null where there is no number to trust. */
  at(x: number, y: number): number | null {
    if (!this.result) return null;
    this.settle();
    const texel = new Float32Array(4);
    const up = this.result.height - 1 - Math.floor(y);
    this.renderer.readRenderTargetPixels(this.result, Math.floor(x), up, 1, 1, texel);
    return texel[2] === 1 ? texel[0] : null;
  }

  /** Free all that is on the graphics card; the pass may be used again. */
  dispose(): void {
    this.standIns.dispose();
    for (const key of Object.keys(this.resolvers)) {
      this.resolvers[key].dispose();
      delete this.resolvers[key];
    }
    for (const drawn of [this.screen, this.points]) drawn.geometry.dispose();
    this.points.material.dispose();
    for (const target of [this.sums, this.ends, this.checks, this.last, this.result]) target?.dispose();
    this.sums = this.ends = this.checks = this.last = this.result = null;
    this.layout = this.picture = this.checked = "";
    this.settling = null;
  }

  private openWeight(number: number): number {
    return this.precision === "float32" ? OPEN_WEIGHTS[Math.min(number, OPEN_WEIGHTS.length - 1)] : 1;
  }

  private get nothing(): number {
    return this.precision === "float32" ? NOTHING : LARGEST_16;
  }

  private placed(bodies: StandIn[], view: View, range: DepthRange, material: (one: StandIn) => Mesh): Mesh[] {
    return bodies.map((one) => {
      place(one, view, range);
      return material(one);
    });
  }

  private ending(one: StandIn, subpixel: number): Mesh {
    const { material } = one.mesh;
    const side = (Array.isArray(material) ? material[0] : material).side;
    return one.use(`end ${side} ${one.instanced !== null}`, () => {
      const made = nearest(one.uniforms, one.instanced !== null, subpixel);
      made.side = side;
      return made;
    });
  }

  private size(): number[] {
    const size = this.options.size ?? this.renderer.getDrawingBufferSize(new Vector2()).toArray();
    return size.map((n) => Math.max(1, Math.floor(n)));
  }

  /** Make the targets, where they are not there yet in this size. */
  private prepare(width: number, height: number, refine: number, spectral: boolean, opaque: boolean, exits: boolean): void {
    const type = this.precision === "float32" ? FloatType : HalfFloatType;
    const layout = [width, height, refine, type, spectral, opaque, exits].join();
    if (layout === this.layout) return;
    for (const target of [this.sums, this.ends, this.checks, this.last, this.result]) target?.dispose();
    const common = {
      depthBuffer: false,
      stencilBuffer: false,
      generateMipmaps: false,
      minFilter: NearestFilter,
      magFilter: NearestFilter,
    } as const;
    const count = spectral ? 2 : 1;
    this.sums = new WebGLRenderTarget(width * refine, height * refine, { ...common, type, format: spectral ? RGBAFormat : RGFormat, count });
    if (spectral) this.sums.textures[1].format = RedFormat;
    this.ends = opaque ? new WebGLRenderTarget(width * refine, height * refine, { ...common, type, format: RedFormat }) : null;
    const check = this.software && refine > 1 && type === FloatType;
    this.checks = check ? new WebGLRenderTarget(width * refine, height * refine, { ...common, type, format: RGBAFormat, depthBuffer: true, stencilBuffer: true }) : null;
    const precise = this.renderer.extensions.has("EXT_color_buffer_float") ? FloatType : HalfFloatType;
    const filled = { ...common, depthBuffer: true, type: precise, format: RGBAFormat };
    this.last = exits ? new WebGLRenderTarget(width, height, filled) : null;
    this.result = new WebGLRenderTarget(width, height, { ...common, type: precise, format: RGBAFormat, count });
    this.result.textures[0].name = "thickness";
    this.layout = layout;
  }

  /**
   * Draw again what is near edges of faces, moved by more than the rasterizer moves vertices, each way. Where its grid decides
   * which of two faces is shown, one of these pictures shows the other one.
   */
  private checkEdges(bodies: StandIn[], rectangle: [number, number, number, number], switches: Omit<Summing, "instanced">, diagonal: number): void {
    const { check, checks, sums } = this;
    check.accumulated.value = sums!.textures.at(-1)!;
    check.refine.value = sums!.width / this.result!.width;
    check.limit.value = (WRONG / 4) * diagonal;
    check.rectangle.value.fromArray(rectangle);
    this.points.geometry.setDrawRange(0, Math.max(rectangle[2] * rectangle[3], 0));
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.draw(checks!, [], [0, 0, 0, 0]);
    this.renderer.state.buffers.stencil.setMask(0xff);
    gl.clearBufferiv(gl.STENCIL, 0, [0]);
    this.draw(checks!, [this.points], null);
    const meshes = bodies.map((one) => {
      const all = { ...switches, instanced: one.instanced !== null };
      return one.use(`check ${Object.values(all)}`, () => checking(one.uniforms, all, check));
    });
    const { width, height } = sums!;
    const [right, up] = [(2 * CHECK_SHIFT * switches.subpixel) / width, (2 * CHECK_SHIFT * switches.subpixel) / height];
    for (let i = 0; i < 4; i++) {
      check.channel.value.set(0, 0, 0, 0).setComponent(i, 1);
      check.shift.value.set(i & 1 ? right : -right, i & 2 ? up : -up);
      this.draw(checks!, meshes, null);
    }
  }

  /** Draw where rays leave the bodies. */
  private leave(bodies: StandIn[]): void {
    const { buffers } = this.renderer.state;
    const reversed = buffers.depth.getReversed();
    const leaving = (one: StandIn): Mesh => {
      const instanced = one.instanced !== null;
      return one.use(`exit ${instanced} ${reversed}`, () => last(one.uniforms, instanced, reversed));
    };
    this.draw(this.last!, bodies.map(leaving), [0, 0, 0, 0], reversed ? 1 : 0);
  }

  /** Sums to metres. */
  private finish(view: View, media: Box3, spectral: boolean, diagonal: number, expected: number[]): void {
    const { resolve, sums, result } = this;
    const precise = this.precision === "float32";
    resolve.accumulated.value = sums!.textures[0];
    resolve.accumulated_path.value = sums!.textures[1] ?? null;
    resolve.refine.value = sums!.width / result!.width;
    resolve.frame_size.value.set(result!.width, result!.height, 0, 0);
    view.setRays(resolve.ray_right.value, resolve.ray_up.value, resolve.ray_forward.value);
    resolve.expected_count.value.set(expected[0], expected[1]);
    resolve.rounding.value = (precise ? ROUNDING : ROUNDING_16) * diagonal;
    resolve.count_share.value = diagonal;
    resolve.coverage_floor.value = (precise ? COVERAGE_FLOOR : ROUNDING_16) * diagonal;
    resolve.checks.value = this.checks?.texture ?? null;
    resolve.disagreement.value = WRONG * diagonal;
    const key = `${spectral} ${this.checks !== null}`;
    this.resolvers[key] ??= resolving(resolve, spectral, this.checks !== null);
    this.screen.material = this.resolvers[key];
    // Where no body is, no number has to be found.
    const everywhere = expected[0] !== 0 || expected[1] !== 0;
    const [x, y, w, h] = everywhere ? [0, 0, result!.width, result!.height] : view.rectangle(media);
    this.draw(result!, [], [0, 0, 1, 0]);
    if (w <= 0 || h <= 0) return;
    result!.scissor.set(x, y, w, h);
    result!.scissorTest = true;
    this.draw(result!, [this.screen], null);
    result!.scissorTest = false;
  }

  private draw(target: WebGLRenderTarget, meshes: Object3D[], cleared: number[] | null, depth?: number): void {
    const { renderer, stage } = this;
    renderer.setRenderTarget(target);
    if (cleared !== null) {
      renderer.state.buffers.color.setMask(true);
      const gl = renderer.getContext() as WebGL2RenderingContext;
      target.textures.forEach((_, i) => gl.clearBufferfv(gl.COLOR, i, i ? [0, 0, 0, 0] : cleared));
    }
    if (depth !== undefined) {
      renderer.state.buffers.depth.setMask(true);
      (renderer.getContext() as WebGL2RenderingContext).clearBufferfv(0x1801, 0, [depth]); // gl.DEPTH
    }
    if (!meshes.length) return;
    stage.children = meshes; // none of them is anybody else's child
    renderer.render(stage, this.eye);
    stage.children = [];
  }

  private save() {
    const { renderer } = this;
    const saved = {
      target: renderer.getRenderTarget(),
      face: renderer.getActiveCubeFace(),
      level: renderer.getActiveMipmapLevel(),
      autoClear: renderer.autoClear,
      xr: renderer.xr.enabled,
      shadows: renderer.shadowMap.autoUpdate,
      info: renderer.info.autoReset,
    };
    renderer.autoClear = renderer.xr.enabled = renderer.shadowMap.autoUpdate = renderer.info.autoReset = false;
    return saved;
  }

  private restore(saved: ReturnType<ExactThicknessPass["save"]>): void {
    const { renderer } = this;
    renderer.autoClear = saved.autoClear;
    renderer.xr.enabled = saved.xr;
    renderer.shadowMap.autoUpdate = saved.shadows;
    renderer.info.autoReset = saved.info;
    renderer.setRenderTarget(saved.target, saved.face, saved.level);
  }
}
