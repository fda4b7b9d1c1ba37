// Plays recorded frames in WebGL2: the steps of translucent/gpu/recording, with the numbers of a camera and a material.

import { drawsInSoftware } from "../software.ts";
import { fieldsOf, writeBlocks } from "./blocks.js";
import { changedLight } from "./albedos.js";
import { drawn } from "./meshes.js";
import { sceneHierarchies } from "./hierarchy.js";

const BLEND = 1, DEPTH_TEST = 2, CULL_FACE = 4;
const BODY_STRIDE = 512;
const HIERARCHY_WIDTH = 4096;

/** Abilities of this WebGL2, and what is used in place of those that it lacks. */
export function capabilitiesOf(gl, half = false) {
  const color = gl.getExtension("EXT_color_buffer_float");
  const blend = gl.getExtension("EXT_float_blend");
  const linear = gl.getExtension("OES_texture_float_linear");
  const targets = color ?? gl.getExtension("EXT_color_buffer_half_float");
  gl.getExtension("KHR_parallel_shader_compile");
  return {
    targets: Boolean(targets),
    float: Boolean(color) && !half,
    blend: Boolean(color && blend) && !half,
    linear: Boolean(linear),
    units: gl.getParameter(gl.MAX_TEXTURE_IMAGE_UNITS),
    drawBuffers: gl.getParameter(gl.MAX_DRAW_BUFFERS),
    largest: gl.getParameter(gl.MAX_TEXTURE_SIZE),
    subpixel: 0.5 ** gl.getParameter(gl.SUBPIXEL_BITS),
    software: drawsInSoftware(gl),
  };
}

export class Player {
  /**
   * @param {WebGL2RenderingContext} gl
   * @param {object} page header of the page's container
   * @param {object} meshes as meshes.js makes them
   * @param {boolean} half use 16 bits everywhere, as where there are no targets of floats
   */
  constructor(gl, page, meshes, half = false) {
    this.gl = gl;
    this.page = page;
    this.meshes = meshes;
    this.caps = capabilitiesOf(gl, half);
    this.programs = new Map();
    this.textures = new Map();
    this.buffers = new Map();
    this.arrays = new Map();
    this.sized = new Map();
    this.blockBuffers = new Map();
    this.onces = new Map();
    this.blended = this.#blendedTargets();
    this.live = {};
    this.drawn = [];
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.pixelStorei(gl.PACK_ALIGNMENT, 1);
  }

  /** Textures into which passes add with blending: float targets may exist without it. */
  #blendedTargets() {
    const found = new Set();
    for (const variant of Object.values(this.page.variants)) {
      for (const steps of [variant.once, variant.media, variant.single, variant.averaged]) {
        for (const step of steps) {
          if (step.op === "draw" && step.flags & BLEND) {
            this.page.framebuffers[step.target].colors.forEach((texture) => found.add(texture));
          }
        }
      }
    }
    return found;
  }

  /** Set the blocks of a variant: what they hold but for camera and material. */
  #liveOf(key) {
    if (this.live[key]) return this.live[key];
    const { page } = this;
    const variant = page.variants[key];
    const blocks = {}, bytes = {};
    for (const [name, section] of Object.entries(variant.blocks)) {
      bytes[name] = page.sections[section].slice().buffer;
      blocks[name] = fieldsOf(page.layout.blocks[name], bytes[name]);
    }
    const layout = page.layout.blocks.Body;
    const together = new Uint8Array(BODY_STRIDE * page.scene.objects.length);
    variant.bodies.forEach((section, i) => together.set(page.sections[section].subarray(0, layout.size), i * BODY_STRIDE));
    const bodies = variant.bodies.map((_, i) => fieldsOf(layout, together.buffer, i * BODY_STRIDE));
    return (this.live[key] = { blocks, bytes, bodies, together });
  }

  /**
   * Play a frame.
   * @param {object} view camera, size, and `sample` of `samples`, or none; `shift` (right, down) in pixels, else that of the sample
   * @param {object} material see material.js
   */
  frame(view, material) {
    const { page } = this;
    const key = material.variant;
    const variant = page.variants[key];
    const live = this.#liveOf(key);
    const { camera, size } = view;
    const several = view.sample != null;
    material.write(live.blocks, live.bodies, variant);
    if (live.blocks.Shadows) {
      live.blocks.Shadows.sky_first[0] = several ? view.sample : 0;
      live.blocks.Shadows.sky_step[0] = several ? page.samples : 1;
    }
    const where = writeBlocks({
      scene: page.scene, meshes: this.meshes, variant, blocks: live.blocks, bodies: live.bodies, camera, size,
      shift: view.shift ?? (several ? page.shifts[view.sample] : [0, 0]), subpixel: this.caps.subpixel,
    });
    const shadows = `${key} ${material.shadowKey}`;
    if (variant.once.length && this.shadows !== shadows) {
      this.#play(variant.once, key, size, material, {});
      this.shadows = shadows;
    }
    this.#upload(live);
    const ground = `${shadows} ${material.tableKey}`;
    if (variant.media.length && this.ground !== ground) {
      this.#play(variant.media, key, size, material, {});
      this.ground = ground;
    }
    this.#relight(material.albedo);
    if (several && view.sample === 0) this.clear(variant.targets.average_target, size);
    const uniforms = several ? { microfacet_points: page.microfacet_points[view.sample] } : {};
    this.#play(several ? variant.averaged : variant.single, key, size, material, uniforms);
    return where;
  }

  /** Put light of another albedo into the textures that hold it; null: that of the page. */
  #relight(albedo) {
    const { gl, page } = this;
    const key = albedo?.join() ?? "";
    if (key === (this.lit ?? "")) return;
    this.lit = key;
    for (const number of page.albedos.textures) {
      const { size, content } = page.textures[number];
      const texels = page.sections[content];
      gl.bindTexture(gl.TEXTURE_3D, this.#texture(number, size));
      const found = albedo ? changedLight(page.albedos, texels, size, albedo, page.sections) : texels;
      gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, 0, ...size, gl.RGBA, gl.FLOAT, found);
    }
  }

  #upload(live) {
    const { gl } = this;
    for (const [name, bytes] of Object.entries(live.bytes)) {
      gl.bindBuffer(gl.UNIFORM_BUFFER, this.#blockBuffer(`live ${name}`));
      gl.bufferData(gl.UNIFORM_BUFFER, bytes, gl.DYNAMIC_DRAW);
    }
    gl.bindBuffer(gl.UNIFORM_BUFFER, this.#blockBuffer("live Body"));
    gl.bufferData(gl.UNIFORM_BUFFER, live.together, gl.DYNAMIC_DRAW);
  }

  #blockBuffer(key) {
    if (!this.blockBuffers.has(key)) this.blockBuffers.set(key, this.gl.createBuffer());
    return this.blockBuffers.get(key);
  }

  #play(steps, key, size, material, uniforms) {
    for (const step of steps) {
      if (step.op === "clear") this.#clear(step, size);
      else if (step.op === "mipmaps") this.#mipmaps(step, size);
      else this.#draw(step, key, size, material, uniforms);
    }
  }

  /** Clear all of a framebuffer to 0. */
  clear(target, size) {
    const count = this.page.framebuffers[target].colors.length;
    this.#clear({ target, attachments: [...Array(count).keys()], color: [0, 0, 0, 0], depth: 1 }, size);
  }

  #clear(step, size) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer(step.target, size));
    gl.disable(gl.SCISSOR_TEST);
    gl.colorMask(true, true, true, true);
    gl.depthMask(true);
    for (const i of step.attachments) gl.clearBufferfv(gl.COLOR, i, step.color.map((x) => this.#held(x)));
    if (step.depth != null) gl.clearBufferfv(gl.DEPTH, 0, [step.depth]);
  }

  /** A value that targets of 16 bits hold, too. */
  #held(value) {
    return this.caps.float ? value : Math.max(-65504, Math.min(65504, value));
  }

  #mipmaps(step, size) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#texture(step.texture, size));
    if (this.caps.linear || !this.caps.float) gl.generateMipmap(gl.TEXTURE_2D);
  }

  #draw(step, key, size, material, uniforms) {
    const { gl, page } = this;
    const program = this.#program(step.program);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer(step.target, size));
    const whole = this.#sizeOf(step.target, size);
    const [x, y, width, height] = step.viewport ?? [0, 0, ...whole];
    gl.viewport(x, y, width, height);
    const free = page.textures[page.framebuffers[step.target].colors[0]]?.size != null;
    if (step.scissor && free) {
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(...step.scissor);
    } else {
      gl.disable(gl.SCISSOR_TEST);
    }
    this.#state(step);
    gl.useProgram(program.program);
    let unit = 0;
    for (const [name, location] of Object.entries(program.samplers)) {
      const number = step.textures[name];
      if (number == null) continue;
      gl.activeTexture(gl.TEXTURE0 + unit);
      if (name === "hierarchy_nodes" && step.merged.hierarchy_triangles != null) {
        gl.bindTexture(gl.TEXTURE_2D, this.#hierarchies(number).texture);
      } else if (name === "object_table") {
        gl.bindTexture(gl.TEXTURE_2D, this.#table(step, key, material));
      } else {
        gl.bindTexture(this.#bindingOf(number), this.#texture(number, size));
      }
      gl.uniform1i(location, unit++);
    }
    for (const [name, [kind, value]] of Object.entries(step.uniforms)) {
      const location = program.uniforms[name];
      if (!location) continue;
      let held = uniforms[name] ?? value;
      if (name === "surface_roughness") held = material.roughness(step.body) ?? value;
      setUniform(gl, location, kind, held);
    }
    if (program.uniforms.hierarchy_triangle_row) {
      gl.uniform1i(program.uniforms.hierarchy_triangle_row, this.#hierarchies(step.textures.hierarchy_nodes).triangleRow);
    }
    for (const name of program.blocks) this.#bindBlock(name, step, material);
    const array = this.#array(step, program);
    gl.bindVertexArray(array.object);
    if (array.indexed) gl.drawElements(gl.TRIANGLES, array.count, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(gl.TRIANGLES, 0, array.count);
  }

  #state(step) {
    const { gl } = this;
    const set = (flag, name) => (step.flags & flag ? gl.enable(name) : gl.disable(name));
    set(BLEND, gl.BLEND);
    set(DEPTH_TEST, gl.DEPTH_TEST);
    set(CULL_FACE, gl.CULL_FACE);
    const [factors, equations] = step.blend;
    if (factors.length === 4) gl.blendFuncSeparate(...factors);
    else gl.blendFunc(...factors);
    if (equations.length === 2) gl.blendEquationSeparate(...equations);
    else gl.blendEquation(equations[0]);
    gl.depthFunc({ "<": gl.LESS, "<=": gl.LEQUAL, "1": gl.ALWAYS, ">": gl.GREATER, "==": gl.EQUAL }[step.depth]);
    gl.depthMask(step.depth_mask);
    gl.colorMask(true, true, true, true);
    gl.cullFace(step.cull === "back" ? gl.BACK : gl.FRONT);
    gl.frontFace(step.front === "ccw" ? gl.CCW : gl.CW);
  }

  #bindBlock(name, step, material) {
    const { gl, page } = this;
    const { binding, size } = page.layout.blocks[name];
    const section = step.blocks[name];
    if (section == null) {
      const buffer = this.#blockBuffer(`live ${name}`);
      if (name === "Body") gl.bindBufferRange(gl.UNIFORM_BUFFER, binding, buffer, step.body * BODY_STRIDE, size);
      else gl.bindBufferBase(gl.UNIFORM_BUFFER, binding, buffer);
      return;
    }
    const key = `${name} ${section}`;
    const known = this.blockBuffers.has(key);
    const buffer = this.#blockBuffer(key);
    gl.bindBufferBase(gl.UNIFORM_BUFFER, binding, buffer);
    const changing = name === "Body" && step.object != null;
    if (known && !changing) return;
    const bytes = page.sections[section].slice();
    if (changing) material.writeMap(fieldsOf(page.layout.blocks.Body, bytes.buffer), step.object);
    gl.bindBuffer(gl.UNIFORM_BUFFER, buffer);
    gl.bufferData(gl.UNIFORM_BUFFER, bytes, gl.STATIC_DRAW);
  }

  #sizeOf(target, size) {
    const { colors, depth } = this.page.framebuffers[target];
    return this.page.textures[colors[0] ?? depth].size ?? size;
  }

  /** Programs: compiled when first asked for. */
  #program(number) {
    if (this.programs.has(number)) return this.programs.get(number);
    const found = linked(this.gl, this.page.programs[number], this.page.layout.blocks);
    this.programs.set(number, found);
    return found;
  }

  /** Begin to compile all programs of a variant; drivers do so side by side. */
  warm(key) {
    const { once, media, single, averaged } = this.page.variants[key];
    for (const step of [...once, ...media, ...single, ...averaged]) if (step.op === "draw") begin(this.gl, this.page.programs[step.program]);
  }

  #bindingOf(number) {
    const { gl } = this;
    return { "2d": gl.TEXTURE_2D, array: gl.TEXTURE_2D_ARRAY, "3d": gl.TEXTURE_3D }[this.page.textures[number].kind];
  }

  #texture(number, size) {
    const what = this.page.textures[number];
    const own = what.size == null ? this.#ofSize(size).textures : this.textures;
    if (!own.has(number)) own.set(number, this.#made(number, what, what.size ?? size));
    return own.get(number);
  }

  /** Targets of one picture size; those of few sizes are kept. */
  #ofSize(size) {
    const key = size.join("x");
    let found = this.sized.get(key);
    if (found) {
      this.sized.delete(key);
    } else {
      found = { textures: new Map(), framebuffers: new Map() };
      for (const [old, held] of this.sized) {
        if (this.sized.size < 3) break;
        this.#release(held);
        this.sized.delete(old);
      }
    }
    this.sized.set(key, found);
    return found;
  }

  #release({ textures, framebuffers }) {
    for (const framebuffer of framebuffers.values()) this.gl.deleteFramebuffer(framebuffer);
    for (const texture of textures.values()) {
      if (texture instanceof WebGLRenderbuffer) this.gl.deleteRenderbuffer(texture);
      else this.gl.deleteTexture(texture);
    }
  }

  #made(number, what, size) {
    const { gl } = this;
    if (what.kind === "depth") {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, ...size);
      return buffer;
    }
    const target = this.#bindingOf(number);
    const texture = gl.createTexture();
    gl.bindTexture(target, texture);
    const content = what.content == null ? null : this.page.sections[what.content];
    const [internal, format, type] = this.#format(number, what, content);
    const levels = what.mipmaps ? Math.floor(Math.log2(Math.max(size[0], size[1]))) + 1 : 1;
    if (size.length === 2) {
      gl.texStorage2D(target, levels, internal, ...size);
      if (content) gl.texSubImage2D(target, 0, 0, 0, ...size, format, type, content);
    } else {
      gl.texStorage3D(target, levels, internal, ...size);
      if (content) gl.texSubImage3D(target, 0, 0, 0, 0, ...size, format, type, content);
    }
    const smooth = what.dtype !== "u4" && (what.dtype !== "f4" || this.caps.linear || internal !== gl.RGBA32F);
    const [least, most] = smooth ? what.filter : [gl.NEAREST, gl.NEAREST];
    gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, least);
    gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, most);
    const wraps = [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R];
    wraps.forEach((wrap, i) => gl.texParameteri(target, wrap, what.repeat[i] ? gl.REPEAT : gl.CLAMP_TO_EDGE));
    if (content && what.mipmaps) gl.generateMipmap(target);
    return texture;
  }

  #format(number, what, content) {
    const { gl } = this;
    const channels = [gl.RED, gl.RG, gl.RGB, gl.RGBA][what.components - 1];
    if (what.dtype === "u4") return [gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT];
    if (what.dtype === "f1") return [[gl.R8, gl.RG8, gl.RGB8, gl.RGBA8][what.components - 1], channels, gl.UNSIGNED_BYTE];
    const half = [gl.R16F, gl.RG16F, gl.RGB16F, gl.RGBA16F][what.components - 1];
    if (what.dtype === "f2") return [half, channels, gl.HALF_FLOAT];
    const whole = [gl.R32F, gl.RG32F, gl.RGB32F, gl.RGBA32F][what.components - 1];
    const filtered = what.filter[0] !== gl.NEAREST;
    const narrow = content
      ? filtered && !this.caps.linear
      : !this.caps.float || (!this.caps.blend && this.blended.has(number));
    return [narrow ? half : whole, channels, gl.FLOAT];
  }

  #framebuffer(number, size) {
    const { gl } = this;
    const { colors, depth } = this.page.framebuffers[number];
    const own = this.page.textures[colors[0] ?? depth].size == null ? this.#ofSize(size).framebuffers : this.buffers;
    if (own.has(number)) return own.get(number);
    const framebuffer = gl.createFramebuffer();
    own.set(number, framebuffer);
    const textures = colors.map((texture) => this.#texture(texture, size));
    const buffer = depth == null ? null : this.#texture(depth, size);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    textures.forEach((texture, i) => gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0));
    gl.drawBuffers(textures.length ? textures.map((_, i) => gl.COLOR_ATTACHMENT0 + i) : [gl.NONE]);
    if (buffer) gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, buffer);
    const status = gl.checkFramebufferStatus(gl.FRAMEBUFFER);
    if (status !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost()) {
      throw new Error(`this WebGL2 has no room for the targets of a picture of ${size.join(" x ")} (0x${status.toString(16)})`);
    }
    return framebuffer;
  }

  /** Nodes and triangles of all meshes in one texture. */
  #hierarchies(number) {
    if (this.tree?.number === number) return this.tree;
    const { gl, page } = this;
    if (!this.words) {
      const own = page.hierarchies.meshes.map((mesh) => this.meshes[mesh]);
      this.words = sceneHierarchies(own, page.sections[page.hierarchies.objects], HIERARCHY_WIDTH);
    }
    const { words, rows, triangleRow, spans } = this.words;
    if (rows > this.caps.largest) throw new Error("this WebGL2 has no texture for so many triangles");
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32UI, HIERARCHY_WIDTH, rows);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, HIERARCHY_WIDTH, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return (this.tree = { number, texture, triangleRow, spans });
  }

  /** Table of the objects, with the places of their hierarchies where rays are traced. */
  #table(step, key, material) {
    const { gl, page } = this;
    const number = step.textures.object_table, traced = step.textures.hierarchy_nodes != null;
    const name = `table ${number} ${traced} ${material.tableKey}`;
    if (this.table?.name === name) return this.table.texture;
    if (this.table) gl.deleteTexture(this.table.texture);
    const { size: [width, rows], content } = page.textures[number];
    const table = Float32Array.from(page.sections[content]);
    for (let row = 0; row < rows; row++) {
      const fields = fieldsOf(page.layout.tables.ObjectRow, table.buffer, 16 * width * row);
      material.writeObject(fields, row);
      if (!traced) continue;
      const span = this.#hierarchies(step.textures.hierarchy_nodes).spans[page.hierarchies.meshes.indexOf(page.scene.objects[row].mesh)];
      fields.first_node.set([Math.floor(span.first / 4096), span.first % 4096]);
      fields.node_count.set([Math.floor(span.count / 4096), span.count % 4096]);
    }
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, rows);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, rows, gl.RGBA, gl.FLOAT, table);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    this.table = { name, texture };
    return texture;
  }

  #array(step, program) {
    const key = `${step.mesh} ${step.looks} ${step.program}`;
    if (this.arrays.has(key)) return this.arrays.get(key);
    const { gl } = this;
    const object = gl.createVertexArray();
    gl.bindVertexArray(object);
    let found = { object, indexed: false, count: 3 };
    if (step.mesh != null) {
      const mesh = (this.drawn[step.mesh] ??= drawn(this.meshes[step.mesh]));
      const shared = step.looks === "shared";
      for (const [name, location] of Object.entries(program.attributes)) {
        const [what, width] = {
          offset: shared ? ["offsets", 3] : ["corners", 3],
          normal: ["flatNormals", 3],
          corner_normal: ["cornerNormals", 3],
          uv: ["cornerUv", 2],
          corner_color: ["cornerColors", 4],
        }[name];
        gl.bindBuffer(gl.ARRAY_BUFFER, this.#vertices(step.mesh, what, () => mesh[what]));
        gl.enableVertexAttribArray(location);
        gl.vertexAttribPointer(location, width, gl.FLOAT, false, 0, 0);
      }
      if (shared) gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.#vertices(step.mesh, "faces", () => mesh.faces, gl.ELEMENT_ARRAY_BUFFER));
      found = { object, indexed: shared, count: mesh.faces.length };
    }
    gl.bindVertexArray(null);
    this.arrays.set(key, found);
    return found;
  }

  #vertices(number, what, content, target = this.gl.ARRAY_BUFFER) {
    const key = `mesh ${number} ${what}`;
    if (!this.blockBuffers.has(key)) {
      const buffer = this.gl.createBuffer();
      this.gl.bindBuffer(target, buffer);
      this.gl.bufferData(target, content(), this.gl.STATIC_DRAW);
      this.blockBuffers.set(key, buffer);
    }
    return this.blockBuffers.get(key);
  }

  /** Texture that holds a result of the last frame of this size. */
  result(name, key, size) {
    const number = this.page.variants[key].targets[name];
    return number == null ? null : this.#texture(number, size);
  }

  /** Floats of a result, (h, w, 4), first row as it was written, or of a part of it. */
  read(name, key, size, part = null) {
    const { gl } = this;
    const texture = this.result(name, key, size);
    if (!texture) return null;
    const [x, y, width, height] = part ?? [0, 0, ...size];
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    let found;
    if (name === "flags") {
      const bytes = new Uint8Array(4 * width * height);
      gl.readPixels(x, y, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      found = Float32Array.from(bytes);
    } else {
      found = new Float32Array(4 * width * height);
      gl.readPixels(x, y, width, height, gl.RGBA, gl.FLOAT, found);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(framebuffer);
    return found;
  }

  /** Write the flags of the last frame of this size, as `read` gives them. */
  writeFlags(key, size, flags) {
    const { gl } = this;
    const number = this.page.variants[key].targets.flags;
    const { components } = this.page.textures[number];
    const [, format, type] = this.#format(number, this.page.textures[number], null);
    const bytes = Uint8Array.from({ length: components * size[0] * size[1] }, (_, i) => flags[4 * Math.floor(i / components) + (i % components)]);
    gl.bindTexture(gl.TEXTURE_2D, this.#texture(number, size));
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, ...size, format, type, bytes);
  }

  /** Wait until all has been drawn. */
  finish() {
    const { gl } = this;
    const pixel = new Uint8Array(4);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  }
}

function setUniform(gl, location, kind, value) {
  const flat = Array.isArray(value) ? value.flat(2) : [Number(value)];
  const width = /[234]$/.test(kind) ? kind.at(-1) : "1";
  const letter = kind.startsWith("u") ? "ui" : kind.startsWith("i") || kind.startsWith("b") ? "i" : "f";
  gl[`uniform${width}${letter}v`](location, flat);
}

const begun = new WeakMap();

/** Compile and link without waiting. */
function begin(gl, texts) {
  let own = begun.get(gl);
  if (!own) begun.set(gl, (own = new Map()));
  const key = texts[0] + texts[1];
  if (own.has(key)) return own.get(key);
  const program = gl.createProgram();
  const shaders = [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].map((kind, i) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, texts[i]);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    return shader;
  });
  gl.linkProgram(program);
  own.set(key, { program, shaders });
  return own.get(key);
}

/** Forget programs of a lost context. */
export function forget(gl) {
  begun.delete(gl);
}

/** A linked program with the places of its inputs. */
export function linked(gl, texts, layouts) {
  const { program, shaders } = begin(gl, texts);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    const told = [...shaders.map((shader) => gl.getShaderInfoLog(shader)), gl.getProgramInfoLog(program)];
    throw new Error(`a shader does not compile here: ${told.filter(Boolean).join("; ")}`);
  }
  const found = { program, samplers: {}, uniforms: {}, attributes: {}, blocks: [] };
  const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
  for (let i = 0; i < count; i++) {
    const info = gl.getActiveUniform(program, i);
    const name = info.name.replace(/\[0\]$/, "");
    const location = gl.getUniformLocation(program, info.name);
    if (!location) continue;
    const samplers = [gl.SAMPLER_2D, gl.SAMPLER_2D_ARRAY, gl.SAMPLER_3D, gl.UNSIGNED_INT_SAMPLER_2D];
    (samplers.includes(info.type) ? found.samplers : found.uniforms)[name] = location;
  }
  const inputs = gl.getProgramParameter(program, gl.ACTIVE_ATTRIBUTES);
  for (let i = 0; i < inputs; i++) {
    const { name } = gl.getActiveAttrib(program, i);
    if (!name.startsWith("gl_")) found.attributes[name] = gl.getAttribLocation(program, name);
  }
  const blocks = gl.getProgramParameter(program, gl.ACTIVE_UNIFORM_BLOCKS);
  for (let i = 0; i < blocks; i++) {
    const name = gl.getActiveUniformBlockName(program, i);
    gl.uniformBlockBinding(program, i, layouts[name].binding);
    found.blocks.push(name);
  }
  return found;
}
