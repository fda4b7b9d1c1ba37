// Picture of a frame: its radiance through a tone curve, or thickness in false colors.

import { linked } from "./player.js";

const FALSE_COLORS = `#version 300 es
precision highp float;
uniform sampler2D thickness;
uniform sampler2D flags;
uniform sampler2D colors;
uniform float most;
out vec4 shown;
void main() {
  ivec2 size = textureSize(thickness, 0);
  ivec2 at = ivec2(gl_FragCoord.x, float(size.y) - gl_FragCoord.y);
  int flag = int(texelFetch(flags, at, 0).r * 255.0 + 0.5);
  float metres = texelFetch(thickness, at, 0).r;
  vec3 color = texelFetch(colors, ivec2(int(clamp(metres / most, 0.0, 1.0) * 255.0 + 0.5), 0), 0).rgb;
  if ((flag & 1) == 0) color = vec3(0.09);
  if ((flag & 2) == 0) color = vec3(1.0, 0.0, 0.5);
  shown = vec4(color, 1.0);
}`;

export class Presenter {
  constructor(gl, page) {
    this.gl = gl;
    this.page = page;
    this.empty = gl.createVertexArray();
    this.programs = new Map();
  }

  #program(name) {
    if (!this.programs.has(name)) {
      const vertex = this.page.present.vertex;
      const fragment = name === "thickness" ? FALSE_COLORS : this.page.present[name];
      this.programs.set(name, linked(this.gl, [vertex, fragment], this.page.layout.blocks));
    }
    return this.programs.get(name);
  }

  #draw(program, textures, size) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, ...size);
    for (const what of [gl.BLEND, gl.DEPTH_TEST, gl.CULL_FACE, gl.SCISSOR_TEST]) gl.disable(what);
    gl.colorMask(true, true, true, true);
    Object.entries(textures).forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(program.samplers[name], unit);
    });
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  picture(texture, size, stops, tone) {
    const program = this.#program(tone);
    this.gl.useProgram(program.program);
    this.gl.uniform1f(program.uniforms.stops, stops);
    this.#draw(program, { picture: texture }, size);
  }

  thickness(metres, flags, size, most) {
    const { gl } = this;
    if (!this.colors) {
      this.colors = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, this.colors);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGB8, 256, 1);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 256, 1, gl.RGB, gl.UNSIGNED_BYTE, this.page.sections[this.page.false_colors]);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    }
    const program = this.#program("thickness");
    gl.useProgram(program.program);
    gl.uniform1f(program.uniforms.most, most);
    this.#draw(program, { thickness: metres, flags, colors: this.colors }, size);
  }
}
