// Media of a page as its panel changes them, and what blocks and tables hold of them.

import { aheadShares, albedoOf, mediumOf } from "./albedos.js";

const BLACKEST = 1e-5;
const MOST_DEPTH = 1e30;
/** Types of objects, as the table of objects numbers them. */
const THIN_WALL = 1, ABSORBER = 4;
const USUAL_IOR = 1.5, USUAL_ROUGHNESS = 0.5;

const linearOf = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
const encodedOf = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);

/** Linear color of text such as #7b1e3a. */
export function colorOf(text) {
  return [1, 3, 5].map((i) => linearOf(parseInt(text.slice(i, i + 2), 16) / 255));
}

/** Text of a linear color. */
export function hexOf(color) {
  const bytes = color.map((x) => Math.round(255 * encodedOf(Math.min(Math.max(x, 0), 1))));
  return `#${bytes.map((x) => x.toString(16).padStart(2, "0")).join("")}`;
}

/** Extinction in 1/m by which white light has a linear color after metres. */
export function extinctionOf(color, metres) {
  return color.map((x) => -Math.log(Math.min(Math.max(x, BLACKEST), 1)) / metres);
}

/** Color that white light has after metres. */
export function colorAfter(extinction, metres) {
  return extinction.map((sigma) => Math.exp(-sigma * metres));
}

export class Materials {
  constructor(page) {
    this.page = page;
    this.reset();
  }

  reset() {
    this.media = this.page.scene.media.map(({ extinction, ior, roughness, distance, has_albedo }) => ({
      extinction: [...extinction], ior, roughness, distance, preset: "", changed: false,
      albedo: has_albedo ? [...this.page.albedos.albedo] : null,
    }));
  }

  /** Change a medium; raises nothing for what is out of range, but keeps it in. */
  set(index, { extinction, ior, roughness, distance, preset = "" }) {
    const medium = this.media[index];
    medium.preset = preset;
    if (extinction) medium.extinction = extinction.map((x) => Math.max(0, Number(x)));
    if (ior != null) medium.ior = Math.min(Math.max(Number(ior), 1), 3);
    if (roughness != null) medium.roughness = Math.min(Math.max(Number(roughness), 0), 1);
    if (distance != null && distance > 0) medium.distance = Number(distance);
    medium.changed = true;
  }

  /** Change the albedo of a scattering medium, by itself or by the linear color of thick parts in white light. */
  setAlbedo(index, { albedo, color }) {
    const told = this.page.albedos, medium = this.media[index];
    const wanted = albedo ?? albedoOf(told, color);
    medium.albedo = wanted.map((x) => Math.min(Math.max(Number(x), told.least), 1));
    medium.extinction = mediumOf(told, medium.albedo).extinction;
    medium.changed = true;
  }

  /** Albedo of the scattering medium, if it is not that of the page. */
  get albedo() {
    return this.media.find((medium) => medium.albedo && medium.changed)?.albedo ?? null;
  }

  get #free() {
    return this.media.filter((_, i) => this.page.scene.media[i].editable);
  }

  get #changed() {
    return this.media.some((medium) => medium.changed);
  }

  /** Key of the variant whose passes and switches these media need. */
  get variant() {
    if (!this.#changed) return "base";
    const bends = this.#free.some((medium) => medium.ior !== 1);
    const rough = this.#free.some((medium) => medium.roughness > 0);
    const key = `${bends ? "bends" : "straight"} ${rough ? "rough" : "smooth"}`;
    return this.page.aliases[key] ?? "base";
  }

  /** Key of all that maps of shadows hold of media. */
  get shadowKey() {
    return this.page.spectral_maps ? this.media.map((medium) => medium.extinction.join()).join(";") : "";
  }

  /** Key of all that tables hold of media. */
  get tableKey() {
    return JSON.stringify([this.variant, this.media]);
  }

  #bounded(index) {
    const limit = MOST_DEPTH / this.page.scene.diagonal;
    return this.media[index].extinction.map((x) => Math.min(x, limit));
  }

  #editable(object) {
    const { medium } = this.page.scene.objects[object];
    if (medium == null) return null;
    const { editable, has_albedo } = this.page.scene.media[medium];
    return editable || (has_albedo && this.media[medium].changed) ? medium : null;
  }

  roughness(object) {
    const medium = object == null ? null : this.#editable(object);
    return medium == null || !this.media[medium].changed || this.media[medium].albedo ? null : this.media[medium].roughness;
  }

  /** Write the blocks of a frame. */
  write(blocks, bodies, variant) {
    const { scene } = this.page;
    scene.objects.forEach((_, i) => this.#writeBody(bodies[i], i));
    const first = this.#editable(scene.first_body);
    if (blocks.Shade && first != null) blocks.Shade.extinction.set(this.#bounded(first));
    if (blocks.Shadows && first != null && scene.first_throwing === scene.first_body) {
      blocks.Shadows.shadow_extinction.set(this.#bounded(first));
    }
    if (blocks.Media) {
      variant.slots.forEach((objects, i) => {
        const medium = this.#editable(objects[0]);
        if (medium != null) blocks.Media.slot_extinction.set(this.#bounded(medium), 4 * i);
      });
    }
  }

  #writeBody(fields, object) {
    const medium = this.#editable(object);
    if (medium == null) return;
    fields.extinction.set(this.#bounded(medium));
    fields.sheet_ior[0] = this.media[medium].ior;
  }

  /** Write the Body block of an object in a map of shadows. */
  writeMap(fields, object) {
    const medium = this.#editable(object);
    if (medium != null) fields.extinction.set(this.#bounded(medium));
  }

  /** Write an object's row of the table of objects. */
  writeObject(row, object) {
    const medium = this.#editable(object);
    if (medium == null) return;
    const { ior, roughness, changed, albedo } = this.media[medium];
    const sigma = this.#bounded(medium);
    const metres = row.type[0] === THIN_WALL || row.type[0] === ABSORBER ? this.page.scene.objects[object].sheet ?? 1 : 1;
    row.extinction.set(sigma.map((x) => metres * x));
    row.ior[0] = ior;
    row.stream_absorption.set(sigma.map((x) => 2 * x));
    row.inner_mirror[0] = this.#innerMirror(ior);
    if (albedo) this.#writeScattering(row, object, albedo);
    else if (changed) row.roughness[0] = roughness;
  }

  #writeScattering(row, object, albedo) {
    const { albedos } = this.page;
    const { absorption, scattering, extinction } = mediumOf(albedos, albedo);
    const shares = aheadShares(row.inner_mirror[0], absorption, albedos.objects[object]);
    row.albedo.set(albedo);
    row.ahead.set(scattering.map((sigma, c) => (Math.max(albedos.anisotropy, 0) * sigma) / extinction[c]));
    row.in_scattered_far.set(shares.map(([far]) => far));
    row.in_scattered_near.set(shares.map(([, near]) => near));
  }

  #innerMirror(ior) {
    const { inner_mirror: values } = this.page;
    const at = ((ior - 1) / 2) * (values.length - 1);
    const i = Math.min(Math.floor(at), values.length - 2);
    return values[i] + (at - i) * (values[i + 1] - values[i]);
  }
}

export { USUAL_IOR, USUAL_ROUGHNESS };
