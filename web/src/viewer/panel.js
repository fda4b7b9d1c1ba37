// The panel beside the picture: material, view, probe, and what the page does not show.

import { reflectanceOf } from "./albedos.js";
import { colorAfter, hexOf } from "./material.js";

/** CSS pixels by which a finger that taps may move. */
const TAP = 10;

const UNITS = { mm: 1e-3, cm: 1e-2, m: 1 };

const STYLE = `
:host, .viewer { all: initial; }
.viewer { position: relative; display: block; width: 100%; height: 100%; background: #131416; color: #d6d8dc;
  font: 13px/1.45 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; container-type: size; overflow: hidden; }
.viewer * { box-sizing: border-box; font: inherit; color: inherit; }
.layout { display: grid; width: 100%; height: 100%; grid-template: minmax(0, 1fr) 30px / minmax(0, 1fr) 336px; }
.layout.bare { grid-template-columns: minmax(0, 1fr) 0; }
.layout.bare .panel { display: none; }
.stage { position: relative; overflow: hidden; background: #131416; }
canvas { position: absolute; inset: 0; width: 100%; height: 100%; display: block; touch-action: none; cursor: grab; outline: none; }
canvas:active { cursor: grabbing; }
canvas:focus-visible { box-shadow: inset 0 0 0 2px #6f9fd8; }
.probe { display: flex; gap: 16px; align-items: center; padding: 0 12px; background: #191a1d; border-top: 1px solid #26282c;
  font-variant-numeric: tabular-nums; white-space: nowrap; overflow: hidden; color: #9ea2a9; }
.probe b { color: #e8e9ec; font-weight: 600; }
.probe .grow { flex: 1; }
.probe .at { min-width: 0; overflow: hidden; text-overflow: ellipsis; }
.probe .quality { flex: 0 99 auto; min-width: 0; overflow: hidden; text-overflow: ellipsis; }
.chip { display: inline-block; width: 12px; height: 12px; border-radius: 3px; vertical-align: -1px; border: 1px solid #3a3d42; }
.panel { grid-column: 2; grid-row: 1 / 3; overflow-y: auto; background: #191a1d; border-left: 1px solid #26282c;
  padding: 14px 16px 18px; display: flex; flex-direction: column; gap: 14px; scrollbar-color: #3a3d42 transparent; }
h1 { margin: 0; font-size: 14px; font-weight: 600; color: #f0f1f3; overflow-wrap: anywhere; }
.group { display: grid; grid-template-columns: 72px minmax(0, 1fr); gap: 9px 8px; align-items: center; }
.group > label, .group > .name { color: #9ea2a9; }
.row { display: flex; gap: 6px; align-items: center; min-width: 0; }
.row > * { min-width: 0; }
.row > span { flex: none; }
#unit { width: 54px; flex: none; padding: 0 2px; }
#distance { flex: 1; min-width: 84px; appearance: textfield; }
input[type="number"], select { width: 100%; height: 28px; padding: 0 7px; background: #242629; border: 1px solid #34373c; border-radius: 5px; }
input[type="color"] { width: 34px; height: 28px; flex: none; padding: 2px; background: #242629; border: 1px solid #34373c; border-radius: 5px; cursor: pointer; }
input[type="range"] { flex: 1; min-width: 0; height: 28px; accent-color: #7fb0ea; cursor: pointer; }
input[type="range"] + input[type="number"] { width: 62px; flex: none; }
input[type="number"]:focus-visible, select:focus-visible, button:focus-visible, summary:focus-visible, input:focus-visible { outline: 2px solid #6f9fd8; outline-offset: 1px; }
:disabled { opacity: 0.45; cursor: not-allowed !important; }
.segments { display: flex; background: #242629; border: 1px solid #34373c; border-radius: 6px; padding: 2px; }
.segments button { flex: 1; height: 26px; border: 0; border-radius: 4px; background: none; color: #b6bac0; cursor: pointer; }
.segments button[aria-pressed="true"] { background: #3b4048; color: #fff; }
.buttons { display: flex; gap: 8px; }
.buttons button { flex: 1; height: 30px; background: #242629; border: 1px solid #34373c; border-radius: 5px; cursor: pointer; }
.buttons button:hover, .segments button:hover { color: #fff; }
.scale { display: none; }
.scale.on { display: block; }
.scale canvas { position: static; width: 100%; height: 12px; border-radius: 3px; cursor: default; }
.scale .marks { display: flex; justify-content: space-between; color: #9ea2a9; font-size: 12px; font-variant-numeric: tabular-nums; }
details { border-top: 1px solid #26282c; padding-top: 10px; }
summary { cursor: pointer; color: #b6bac0; }
details ul { margin: 8px 0 0; padding-left: 16px; color: #9ea2a9; display: grid; gap: 6px; overflow-wrap: anywhere; }
details dl { margin: 8px 0 0; display: grid; grid-template-columns: auto 1fr; gap: 4px 12px; color: #9ea2a9; }
details dt { color: #d6d8dc; } details dd { margin: 0; }
.mark { color: #f0b46a; }
.told { position: absolute; left: 50%; bottom: 14px; transform: translateX(-50%); width: max-content; max-width: 90%; padding: 8px 14px; border-radius: 6px;
  background: #2b2d31; color: #f0f1f3; display: none; }
.told.on { display: block; }
.poster { position: absolute; inset: 0; width: 100%; height: 100%; object-fit: contain; }
.busy { width: 100%; height: 2px; position: absolute; left: 0; bottom: 0; transform-origin: left; background: #7fb0ea; opacity: 0.8; transform: scaleX(0); }
@container (max-width: 680px) {
  .layout { grid-template: minmax(0, 1fr) 30px minmax(0, 42cqh) / minmax(0, 1fr); }
  .panel { grid-column: 1; grid-row: 3; border-left: 0; border-top: 1px solid #26282c; padding: 12px 14px 16px; gap: 12px; }
  .layout.bare { grid-template: minmax(0, 1fr) 30px 0 / minmax(0, 1fr); }
  .probe { gap: 12px; padding: 0 10px; font-size: 12px; }
  .probe .wide { display: none; }
  input[type="number"], select, input[type="color"], input[type="range"], .segments button, .buttons button { height: 36px; }
}`;

const BODY = `
<div class="layout">
  <div class="stage"><canvas tabindex="0" role="img"></canvas><div class="busy"></div><div class="told" role="status"></div></div>
  <div class="probe"><span class="at">Point at the model, or tap it: thickness and transmittance</span><span class="grow"></span><span class="quality wide"></span></div>
  <div class="panel">
    <h1></h1>
    <div class="segments" role="group" aria-label="View">
      <button data-show="picture" aria-pressed="true">Picture</button><button data-show="thickness" aria-pressed="false">Thickness</button>
    </div>
    <div class="scale"><canvas width="256" height="1"></canvas><div class="marks"></div></div>
    <div class="group material">
      <label for="medium" class="several">Medium</label><select id="medium" class="several"></select>
      <p class="fixed" style="margin:0;grid-column:1/-1;color:#9ea2a9;display:none"></p>
      <label for="preset">Preset</label><select id="preset"></select>
      <label for="color">Color</label>
      <div class="row"><input type="color" id="color" aria-label="Color of white light behind so much of it"><span class="albedo-error"></span><span class="at-distance">at</span>
        <input type="number" class="at-distance" id="distance" min="0" step="any" aria-label="Distance"><select id="unit" class="at-distance" aria-label="Unit of the distance">
        <option>mm</option><option>cm</option><option>m</option></select></div>
      <label for="ior">IOR</label>
      <div class="row"><input type="range" id="ior" min="1" max="2.5" step="0.01"><input type="number" id="ior-number" min="1" max="3" step="0.01" aria-label="Index of refraction"></div>
      <label for="roughness">Roughness</label>
      <div class="row"><input type="range" id="roughness" min="0" max="1" step="0.01"><input type="number" id="roughness-number" min="0" max="1" step="0.01" aria-label="Roughness"></div>
      <label for="exposure">Exposure</label>
      <div class="row"><input type="range" id="exposure" min="-4" max="4" step="0.1"><input type="number" id="exposure-number" min="-10" max="10" step="0.1" aria-label="Exposure in stops"></div>
    </div>
    <div class="buttons"><button data-do="view">Reset view</button><button data-do="material">Reset material</button></div>
    <details class="notes"><summary></summary><ul></ul></details>
    <details class="keys"><summary>Keys and gestures</summary><dl>
      <dt>Tap</dt><dd>read thickness</dd><dt>Drag, arrows</dt><dd>turn</dd><dt>Right drag, two fingers, Shift + arrows</dt><dd>move</dd>
      <dt>Wheel, pinch, + and −</dt><dd>closer, farther</dd><dt>T</dt><dd>thickness</dd>
      <dt>R</dt><dd>reset the view</dd><dt>M</dt><dd>reset the material</dd><dt>P</dt><dd>panel on and off</dd></dl></details>
  </div>
</div>`;

const digits = (x, n = 3) => Number(Number(x).toPrecision(n)).toString();

/** Metres as text, in the unit that suits them. */
function lengthText(metres, like = metres) {
  const size = Math.abs(like);
  if (size >= 1) return `${metres.toFixed(3)} m`;
  return size >= 1e-5 ? `${(1e3 * metres).toFixed(size < 1e-3 ? 4 : 2)} mm` : `${(1e6 * metres).toFixed(2)} µm`;
}

export class Panel {
  constructor(viewer, element, options) {
    this.viewer = viewer;
    this.poster = element.querySelector("img");
    this.root = document.createElement("div");
    this.root.style.cssText = "display:block;width:100%;height:100%;min-height:0";
    this.shadow = this.root.attachShadow({ mode: "open" });
    const style = document.createElement("style");
    style.textContent = STYLE;
    const held = document.createElement("div");
    held.className = "viewer";
    held.innerHTML = BODY;
    this.shadow.append(style, held);
    this.$ = (query) => this.shadow.querySelector(query);
    this.canvas = this.$(".stage canvas");
    if (options.panel === false) this.$(".layout").classList.add("bare");
    if (this.poster) {
      this.picture = this.poster.cloneNode();
      this.picture.className = "poster";
      this.canvas.after(this.picture); // below what is told
    }
    element.replaceChildren(this.root);
    this.told = [];
    this.medium = Math.max(0, viewer.page.scene.media.findIndex((medium) => medium.editable));
    this.#fill();
  }

  #fill() {
    const { page } = this.viewer;
    this.$("h1").textContent = page.name;
    this.canvas.setAttribute("aria-label", `${page.name}: a scene that can be turned`);
    const { media } = page.scene;
    for (const item of this.shadow.querySelectorAll(".several")) item.style.display = media.length > 1 ? "" : "none";
    this.$("#medium").replaceChildren(...media.map((medium, i) => new Option(medium.name, i)));
    this.$("#preset").replaceChildren(
      new Option("as written", ""), ...page.presets.map(({ name }) => new Option(name.replaceAll("_", " "), name)));
    const ramp = this.$(".scale canvas").getContext("2d");
    const colors = page.sections[page.false_colors];
    const row = ramp.createImageData(256, 1);
    for (let i = 0; i < 256; i++) row.data.set([colors[3 * i], colors[3 * i + 1], colors[3 * i + 2], 255], 4 * i);
    ramp.putImageData(row, 0, 0);
    this.notes([]);
    this.refresh();
    const distance = this.viewer.materials.media[this.medium]?.distance ?? 0.01;
    this.$("#unit").value = distance >= 0.5 ? "m" : distance >= 0.01 ? "cm" : "mm";
    this.refresh();
  }

  /** Show the material as it is; in the number that has the focus, too, once it is entered. */
  refresh(entered = false) {
    const { viewer } = this;
    const medium = viewer.materials.media[this.medium];
    if (!medium) return;
    const told = viewer.page.scene.media[this.medium];
    this.$("#medium").value = this.medium;
    const active = this.shadow.activeElement;
    const set = (id, value) => {
      const field = this.$(id);
      if (entered || field !== active || field.type !== "number") field.value = value;
    };
    // What the page was written with has a name if it is a preset; others that the list lacks cannot be chosen.
    const written = told.preset ? `${told.preset.replaceAll("_", " ")}, as written` : "as written";
    this.$("#preset").options[0].text = medium.changed && !medium.preset ? "of your own" : written;
    set("#preset", medium.preset);
    const { albedos } = viewer.page;
    set("#color", hexOf(medium.albedo ? reflectanceOf(albedos, medium.albedo) : colorAfter(medium.extinction, medium.distance)));
    this.$("#color").ariaLabel = medium.albedo ? "Color of thick parts in white light" : "Color of white light behind so much of it";
    for (const item of this.shadow.querySelectorAll(".at-distance")) item.style.display = medium.albedo ? "none" : "";
    this.$(".albedo-error").textContent = medium.albedo ? `of thick parts, within ${digits(100 * albedos.error, 2)} %` : "";
    set("#distance", digits(medium.distance / UNITS[this.$("#unit").value], 4));
    set("#ior", medium.ior);
    set("#ior-number", digits(medium.ior, 4));
    set("#roughness", medium.roughness);
    set("#roughness-number", digits(medium.roughness, 3));
    set("#exposure", viewer.stops);
    set("#exposure-number", digits(viewer.stops, 3));
    for (const id of ["preset", "color", "distance", "ior", "ior-number", "roughness", "roughness-number"]) {
      this.$(`#${id}`).disabled = !told.editable && !(told.has_albedo && id === "color");
    }
    const fixed = this.$(".fixed");
    fixed.style.display = told.editable ? "none" : "";
    fixed.textContent = told.editable ? "" : told.why;
  }

  listen() {
    const { viewer } = this;
    const change = (values) => viewer.setMaterial(values, this.medium);
    const on = (id, type, what) => this.$(id).addEventListener(type, what);
    on("#medium", "change", () => { this.medium = Number(this.$("#medium").value); this.refresh(); });
    on("#preset", "change", () => {
      const preset = this.$("#preset").value;
      if (preset) change({ preset });
      else viewer.resetMaterial();
    });
    const distance = () => Number(this.$("#distance").value) * UNITS[this.$("#unit").value];
    on("#color", "input", () => change({ color: this.$("#color").value }));
    on("#distance", "change", () => { if (distance() > 0) change({ color: this.$("#color").value, distance: distance() }); });
    for (const name of ["ior", "roughness"]) {
      on(`#${name}`, "input", () => change({ [name]: Number(this.$(`#${name}`).value) }));
      on(`#${name}-number`, "change", ({ target }) => { if (target.value) change({ [name]: Number(target.value) }); });
    }
    for (const id of ["#exposure", "#exposure-number"]) {
      on(id, "input", () => { viewer.setExposure(Number(this.$(id).value) || 0); this.refresh(); });
    }
    // After each field's own: what was out of range, or no number, shows what is kept.
    on(".material", "change", () => this.refresh(true));
    for (const button of this.shadow.querySelectorAll("[data-show]")) button.addEventListener("click", () => this.show(button.dataset.show));
    on('[data-do="view"]', "click", () => viewer.view.reset());
    on('[data-do="material"]', "click", () => viewer.resetMaterial());
    this.canvas.addEventListener("keydown", (event) => this.#key(event));
    // A mouse reads where it is; a finger or a pen what it taps, which stays until the next tap.
    const mouse = (event) => event.pointerType === "mouse";
    this.canvas.addEventListener("pointermove", (event) => { if (mouse(event)) this.#point(event); });
    this.canvas.addEventListener("pointerdown", (event) => { this.down = event; if (mouse(event)) this.pointer = event; });
    this.canvas.addEventListener("pointerup", (event) => {
      const { down } = this;
      const tapped = down?.pointerId === event.pointerId && event.isPrimary
        && Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) < TAP;
      if (!mouse(event) && tapped) this.#point(event);
    });
    this.canvas.addEventListener("pointerleave", (event) => { if (mouse(event)) this.#point(null); });
  }

  #point(event) {
    this.pointer = event;
    this.#probe();
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { view } = this.viewer;
    const step = Math.PI / 36;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const actions = {
      "+": () => view.zoom(0.9), "=": () => view.zoom(0.9), "-": () => view.zoom(1 / 0.9),
      r: () => view.reset(), t: () => this.show(this.viewer.shown === "picture" ? "thickness" : "picture"),
      m: () => this.viewer.resetMaterial(), p: () => this.$(".layout").classList.toggle("bare"),
    };
    const arrow = arrows[event.key];
    if (arrow && event.shiftKey) view.pan(0.05 * arrow[0], 0.05 * arrow[1]);
    else if (arrow) view.turn(step * arrow[0], step * arrow[1]);
    else if (actions[event.key.toLowerCase()]) actions[event.key.toLowerCase()]();
    else return;
    event.preventDefault();
  }

  show(what) {
    for (const button of this.shadow.querySelectorAll("[data-show]")) button.setAttribute("aria-pressed", String(button.dataset.show === what));
    this.$(".scale").classList.toggle("on", what === "thickness");
    this.viewer.show(what);
  }

  scaled(most) {
    const marks = [0, 0.25, 0.5, 0.75, 1].map((share) => lengthText(share * most, most).replace(/ .*/, ""));
    marks[marks.length - 1] = lengthText(most, most);
    this.$(".scale .marks").replaceChildren(...marks.map((text) => Object.assign(document.createElement("span"), { textContent: text })));
  }

  #probe() {
    const line = this.$(".at");
    const event = this.pointer;
    const box = this.canvas.getBoundingClientRect();
    const found = event && this.viewer.probe((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
    if (!found) {
      if (!event) line.textContent = "Point at the model, or tap it: thickness and transmittance";
      return;
    }
    const [red, green, blue] = found.transmittance.map((x) => x.toFixed(3));
    const count = found.layers == null ? `count ${found.count ?? 0}` : `${found.layers} crossings`;
    line.innerHTML = !found.valid
      ? `<b class="mark">not valid</b>: ${found.layers == null ? "" : "more surfaces lie here than are counted, or "}surfaces here do not bound a volume`
      : `<b>${lengthText(found.thickness)}</b> &nbsp; <span class="chip" style="background:${hexOf(found.transmittance)}"></span> ` +
        `<b>${red} ${green} ${blue}</b><span class="wide"> transmittance &nbsp; ${count}</span>`;
  }

  painted(done) {
    const { samples } = this.viewer.page;
    const share = this.viewer.shown === "picture" ? done / samples : 1;
    this.$(".busy").style.transform = `scaleX(${share < 1 ? share : 0})`;
    const small = this.viewer.still_scale < 0.99 ? `${Math.round(100 * this.viewer.still_scale)} % of the pixels across` : "";
    this.$(".quality").textContent = [share < 1 ? `${done} of ${samples} samples` : "", small].filter(Boolean).join(", ");
    this.#probe();
  }

  begun() {
    this.picture?.remove();
    this.picture = null;
  }

  /** Say on the page what it does not show, and what it shows in place of what this machine cannot. */
  notes(told) {
    this.told = told;
    const { page } = this.viewer;
    const all = [...told.map((text) => [text, "mark"]), ...page.notes.map(({ text }) => [text, ""])];
    this.$(".notes").style.display = all.length ? "" : "none";
    this.$(".notes summary").textContent = `What this page leaves out (${all.length})`;
    if (told.length) this.$(".notes").open = true;
    this.$(".notes ul").replaceChildren(...all.map(([text, mark]) => Object.assign(document.createElement("li"), { textContent: text, className: mark })));
    for (const [text] of all) if (!this.said?.has(text)) { console.info(`translucent: ${text}`); (this.said ??= new Set()).add(text); }
  }

  inside(yes) {
    if (yes !== this.isInside) this.say(yes ? "The eye is inside a body: the picture is not right from here." : "");
    this.isInside = yes;
  }

  say(text) {
    this.$(".told").textContent = text;
    this.$(".told").classList.toggle("on", Boolean(text));
  }

  refuse(text) {
    this.say(text);
    for (const field of this.shadow.querySelectorAll(".panel input, .panel select, .panel button")) field.disabled = true;
  }

  focus() {
    this.canvas.focus({ preventScroll: true });
  }

  dispose() {
    this.root.remove();
  }
}
