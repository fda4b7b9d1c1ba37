// A viewer of a page's scene: it plays the renderer's passes, and has a panel for material and view.

import { View } from "./camera.js";
import { opened } from "./container.js";
import { exactThickness } from "./exact.js";
import { Materials, colorOf, extinctionOf } from "./material.js";
import { meshesOf } from "./meshes.js";
import { Panel } from "./panel.js";
import { Player, forget } from "./player.js";
import { Presenter } from "./presenter.js";

const SCALES = [1, 0.7, 0.5, 0.35, 0.25];
const SLOW = 60, FAST = 18;
const MOST_PIXELS = 2560;
const REST = 140;

/** Times that one pixel is enlarged for the probe where WebGL draws in software: a grid of 1/16 pixel becomes one of 1/4096. */
const FINER = 256;

/** Share of the smallest body's diagonal by which thickness that is drawn in software may be off before its pixel is marked. */
const WRONG = 1e-3;

/** Milliseconds that one sample of a still picture may take; else it has fewer pixels. */
const LONGEST = 4000;

/**
 * Show a scene in an element.
 *
 * @param {HTMLElement} element what it had, such as a poster, is taken away with the first picture
 * @param {string | ArrayBuffer | Uint8Array} payload data of `translucent page`: bytes, or base64
 * @param {{half?: boolean, panel?: boolean}} options half: 16 bits, as where WebGL2 has no targets of floats
 * @returns {Promise<Viewer>} with `setMaterial(values, medium)`, `setCamera({eye, target, up})`, `onChange(listener)` and `dispose()`
 */
export async function createViewer(element, payload, options = {}) {
  const page = await opened(payload);
  const viewer = new Viewer(element, page, options);
  await viewer.ready;
  return viewer;
}

export class Viewer {
  constructor(element, page, options) {
    this.element = element;
    this.page = page;
    this.options = options;
    this.listeners = new Set();
    this.meshes = meshesOf(page);
    this.materials = new Materials(page);
    this.shown = "picture";
    this.stops = page.exposure;
    this.scale = 1;
    this.most = 1;
    this.previews = 0;
    this.panel = new Panel(this, element, options);
    this.canvas = this.panel.canvas;
    this.ready = this.#begin();
  }

  async #begin() {
    this.gl = this.canvas.getContext("webgl2", {
      alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true, powerPreference: "high-performance",
    });
    if (!this.gl) {
      this.#refuse("This browser has no WebGL2, which the scene needs: update it, or allow it the graphics card.");
      return;
    }
    this.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.lost = true;
      this.most = Math.max(0.25, 0.7 * this.most);
      forget(this.gl);
      this.panel.say("The graphics card was taken away; waiting for it.");
    });
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.lost = false;
      this.panel.say("");
      this.#start();
      this.#changed();
    });
    this.view = new View(this.page.scene, this.canvas, () => this.#changed());
    this.panel.listen();
    this.#start();
    this.resizing = new ResizeObserver(() => this.#resized());
    this.resizing.observe(this.canvas.parentElement);
    this.#resized();
  }

  #start() {
    this.previews = 0;
    this.player = new Player(this.gl, this.page, this.meshes, this.options.half);
    this.presenter = new Presenter(this.gl, this.page);
    const { caps } = this.player;
    const told = [];
    if (!caps.float) told.push("Thickness in 16 bits, off by some 0.1 %: this WebGL2 has no targets of 32-bit floats.");
    else if (!caps.blend) told.push("Thickness in 16 bits, off by some 0.1 %: this WebGL2 cannot add up 32-bit floats.");
    if (!caps.linear) told.push("Light in 16 bits: this WebGL2 cannot interpolate 32-bit floats.");
    this.panel.notes(told);
    if (!caps.targets) {
      this.#refuse("This WebGL2 draws no pictures of floats, which the scene needs: update the browser, or take another one.");
      return;
    }
    if (caps.drawBuffers < 5) {
      this.#refuse(`This WebGL2 draws into ${caps.drawBuffers} pictures at once, and the scene needs 5.`);
      return;
    }
    this.player.warm("base");
  }

  #refuse(text) {
    this.failed = true;
    this.panel.refuse(text);
    console.warn(`translucent: ${text}`);
  }

  #resized() {
    const { width, height } = this.canvas.parentElement.getBoundingClientRect();
    if (!width || !height) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const fit = Math.min(1, MOST_PIXELS / (ratio * Math.max(width, height)));
    this.full = [width, height].map((x) => Math.max(1, Math.round(x * ratio * fit)));
    this.#changed(false);
  }

  #changed(moving = true) {
    this.done = -1; // samples of the still picture; -1: none at all yet
    this.still = false;
    this.pending = true;
    this.until = performance.now() + (moving && this.painted ? REST : 0);
    this.#schedule();
    if (moving && this.painted) for (const listener of this.listeners) listener(this.state());
  }

  #schedule() {
    if (this.waiting || this.failed || this.lost || this.disposed || !this.player) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      try {
        this.#tick();
      } catch (error) {
        if (!this.gl.isContextLost()) {
          this.#refuse(`This scene cannot be drawn here: ${error.message}.`);
        }
      }
    });
  }

  #tick() {
    if (!this.full || this.lost) return;
    if (performance.now() < this.until) {
      if (this.pending) this.#moving();
      this.pending = false;
      this.#schedule();
      return;
    }
    if (this.previews < 2) {
      // Small at first: it is soon there, and the second one, when all is compiled, tells what a large one would take.
      this.scale = SCALES.at(-1);
      this.#moving();
      this.previews++;
      this.#schedule();
      return;
    }
    if (this.done < 0) {
      const most = Math.min(this.most, Math.max(SCALES.at(-1), Math.sqrt(LONGEST / (this.rate * this.full[0] * this.full[1]))));
      const begun = performance.now();
      this.still_scale = most;
      this.most_metres = null;
      this.#draw(this.#size(most), null);
      if (this.shown === "thickness") this.#mark(this.view.camera(this.view.widened(this.size)));
      this.#present("radiance", this.stops);
      this.player.finish();
      this.cost = performance.now() - begun;
      this.done = 0;
      this.still = true;
      this.painted = true;
      this.panel.painted(0);
      if (this.page.samples > 1) this.#schedule();
      return;
    }
    if (this.done < this.page.samples && this.shown === "picture") {
      const begun = performance.now();
      do {
        this.#draw(this.#size(this.still_scale), this.done);
        this.done++;
        if (this.cost > 12) this.player.finish();
      } while (this.done < this.page.samples && performance.now() - begun + this.cost < 24);
      if (this.done >= 4 || this.done === this.page.samples) {
        this.#present("average", this.stops - Math.log2(this.done));
      }
      // Thickness and all that belongs to the middle of a pixel, for the probe.
      if (this.done === this.page.samples) this.#draw(this.size, null);
      this.panel.painted(this.done);
      if (this.done < this.page.samples) this.#schedule();
    }
  }

  #moving() {
    const begun = performance.now();
    this.#draw(this.#size(this.scale * this.most), null);
    this.#present("radiance", this.stops);
    this.player.finish();
    const took = performance.now() - begun;
    this.rate = took / (this.size[0] * this.size[1]);
    const at = SCALES.indexOf(this.scale);
    if (took > SLOW && at < SCALES.length - 1) this.scale = SCALES[at + 1];
    if (took < FAST && at > 0) this.scale = SCALES[at - 1];
  }

  #size(scale) {
    return this.full.map((x) => Math.max(1, Math.round(x * scale)));
  }

  #draw(size, sample) {
    this.size = size;
    const camera = this.view.camera(this.view.widened(size));
    const where = this.player.frame({ camera, size, sample }, this.materials);
    this.panel.inside(where.inside && !this.page.variants[this.materials.variant].starts_inside);
  }

  #present(name, stops) {
    const [width, height] = this.size;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    const key = this.materials.variant;
    if (this.shown === "thickness") {
      if (this.most_metres == null) this.most_metres = this.#greatest();
      const textures = ["thickness", "flags"].map((what) => this.player.result(what, key, this.size));
      this.presenter.thickness(...textures, this.size, this.most_metres);
    } else {
      this.presenter.picture(this.player.result(name, key, this.size), this.size, stops, this.page.tone);
    }
    this.panel.begun();
  }

  #greatest() {
    const key = this.materials.variant;
    const metres = this.player.read("thickness", key, this.size);
    const flags = this.player.read("flags", key, this.size);
    let most = 0;
    for (let i = 0; i < metres.length; i += 4) if (flags[i] & 1 && flags[i] & 2) most = Math.max(most, metres[i]);
    this.panel.scaled(most);
    return most || 1;
  }

  /** Mark pixels of the frame as invalid where a rasterizer in software shows another face than the ray of the pixel meets. */
  #mark(camera) {
    const { caps } = this.player;
    if (!caps.software || !caps.float || !caps.blend) return; // 16 bits are off everywhere, and told
    const { page, player, meshes, size } = this;
    const key = this.materials.variant;
    const exact = exactThickness({ scene: page.scene, meshes, variant: page.variants[key], camera, size });
    if (!exact) return;
    const bodies = page.scene.objects.filter((body) => !body.opaque);
    const most = WRONG * Math.min(...bodies.map(({ bounds: [low, high] }) => Math.hypot(...high.map((x, k) => x - low[k]))));
    const metres = player.read("thickness", key, size), flags = player.read("flags", key, size);
    this.marked = 0;
    exact.forEach((value, i) => {
      if (!(flags[4 * i] & 2) || Math.abs(value - metres[4 * i]) <= most) return;
      flags[4 * i] = (flags[4 * i] & ~2) | 1;
      this.marked++;
    });
    if (this.marked) player.writeFlags(key, size, flags);
  }

  /** Show the picture, or thickness in false colors. */
  show(what) {
    this.shown = what;
    this.most_metres = null;
    this.#changed(false);
  }

  setExposure(stops) {
    this.stops = Math.min(Math.max(stops, -10), 10);
    if (this.still) {
      if (this.done > 0) this.#present("average", this.stops - Math.log2(this.done));
      else this.#present("radiance", this.stops);
    }
  }

  /**
   * Change a medium.
   * @param {{color?: string, distance?: number, preset?: string, extinction?: number[], ior?: number, roughness?: number, albedo?: number[]}} values
   *   color after distance in metres; names of `presets`; extinction in 1/m. Of a medium that scatters color, of thick
   *   parts in white light, or albedo alone; see `state().media[i].albedo`
   * @param {number} medium
   */
  setMaterial(values, medium = 0) {
    const held = this.materials.media[medium];
    const told = this.page.scene.media[medium];
    if (held && told.has_albedo && (values.albedo || values.color)) {
      this.materials.setAlbedo(medium, { albedo: values.albedo, color: values.color && colorOf(values.color) });
      this.panel.refresh();
      this.#changed();
    }
    if (!held || !told.editable) return;
    const next = { ior: values.ior, roughness: values.roughness, distance: values.distance };
    const preset = this.page.presets.find(({ name }) => name === values.preset);
    if (preset) Object.assign(next, { extinction: preset.extinction, ior: preset.ior, roughness: preset.roughness, preset: preset.name });
    if (values.color) next.extinction = extinctionOf(colorOf(values.color), values.distance ?? held.distance);
    if (values.extinction) next.extinction = values.extinction;
    this.materials.set(medium, next);
    this.panel.refresh();
    this.#changed();
  }

  resetMaterial() {
    this.materials.reset();
    this.panel.refresh();
    this.#changed();
  }

  /** Place the camera: `eye`, `target` and `up` in metres. */
  setCamera(values) {
    this.view?.set(values);
  }

  /** Material and camera as they are. */
  state() {
    const { eye, forward } = this.view.camera();
    return {
      media: this.materials.media.map((medium, i) => ({ name: this.page.scene.media[i].name, ...medium })),
      camera: { eye: [...eye], target: this.view.controls.target.toArray(), forward: [...forward], up: this.view.three.up.toArray() },
    };
  }

  /** Call a listener with `state()` whenever the material or the camera changes; returns what ends that. */
  onChange(listener) {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  /** View of one pixel alone, enlarged so much that by edges the coarse grid of a rasterizer in software shows the right face. */
  #middle(at) {
    const camera = this.view.camera(this.view.widened(this.size));
    const scale = FINER * this.size[1];
    const shift = at.map((pixel, i) => FINER * (pixel + 0.5 - this.size[i] / 2));
    if (camera.fov_y == null) camera.height /= scale;
    else camera.fov_y = (360 / Math.PI) * Math.atan(Math.tan((camera.fov_y * Math.PI) / 360) / scale);
    return { camera, size: [1, 1], sample: null, shift };
  }

  /** Read what is under a place of the canvas, in shares of its width and height from the top left corner. */
  probe(x, y) {
    if (!this.still || this.lost || x < 0 || y < 0 || x >= 1 || y >= 1) return null;
    const key = this.materials.variant;
    let { size } = this;
    let at = [Math.floor(x * size[0]), Math.floor(y * size[1])];
    if (this.player.caps.software) {
      this.player.frame(this.#middle(at), this.materials);
      [size, at] = [[1, 1], [0, 0]];
    }
    const read = (name, row = at[1]) => this.player.read(name, key, size, [at[0], row, 1, 1]);
    const flags = read("flags")[0];
    const count = read("count", size[1] - 1 - at[1]);
    const layers = read("layers", size[1] - 1 - at[1]);
    return {
      covered: Boolean(flags & 1),
      valid: Boolean(flags & 2),
      thickness: read("thickness")[0],
      transmittance: [...read("transmittance").slice(0, 3)],
      count: count ? Math.round(count[this.page.variants[key].spectral ? 3 : 1]) : null,
      layers: layers ? Math.round(layers[0]) : null,
    };
  }

  /**
   * Draw a picture of any size and read it: linear radiance, or a result such as "thickness" or "flags" (1: covered, 2: valid);
   * (h, w, 4), first row at the top.
   * @param {{size: number[], samples?: number, what?: string}} asked
   */
  render({ size, samples = this.page.samples, what = "radiance" }) {
    const key = this.materials.variant;
    const camera = this.view.camera();
    this.size = size;
    this.player.frame({ camera, size, sample: null }, this.materials);
    if (what === "flags") this.#mark(camera);
    let found = this.player.read(what, key, size);
    if (what === "radiance" && samples > 1) {
      for (let i = 0; i < this.page.samples; i++) this.player.frame({ camera, size, sample: i }, this.materials);
      found = this.player.read("average", key, size).map((x) => x / this.page.samples);
    }
    this.#changed(false);
    return found;
  }

  dispose() {
    this.disposed = true;
    cancelAnimationFrame(this.waiting);
    this.resizing?.disconnect();
    this.view?.dispose();
    this.panel.dispose();
    this.gl?.getExtension("WEBGL_lose_context")?.loseContext();
  }
}
