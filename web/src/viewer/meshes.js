// Meshes of a page: what it came with, and what is made of it when a pass asks.

/** Each corner's own value of a vertex attribute. */
function ofCorners(values, width, index) {
  const found = new Float32Array(index.length * width);
  for (let i = 0; i < index.length; i++) {
    for (let k = 0; k < width; k++) found[width * i + k] = values[width * index[i] + k];
  }
  return found;
}

class PageMesh {
  constructor(told, sections) {
    Object.assign(this, { name: told.name, center: told.center, low: told.low, high: told.high, diagonal: told.diagonal });
    this.offsets = sections[told.offsets];
    this.faces = sections[told.faces];
    this.normals = sections[told.normals];
    this.normalIndex = told.normal_index == null ? this.faces : sections[told.normal_index];
    this.uv = told.uv == null ? null : sections[told.uv];
    this.colors = told.colors == null ? null : sections[told.colors];
  }

  normal(corner) {
    const at = 3 * this.normalIndex[corner];
    return [this.normals[at], this.normals[at + 1], this.normals[at + 2]];
  }

  get corners() {
    return ofCorners(this.offsets, 3, this.faces);
  }

  get cornerNormals() {
    return ofCorners(this.normals, 3, this.normalIndex);
  }

  get cornerUv() {
    return this.uv ? ofCorners(this.uv, 2, this.faces) : new Float32Array(2 * this.faces.length);
  }

  get cornerColors() {
    return ofCorners(this.colors, 4, this.faces);
  }

  get flatNormals() {
    const corners = this.corners;
    const found = new Float32Array(corners.length);
    for (let i = 0; i < corners.length; i += 9) {
      const [ax, ay, az] = [corners[i + 3] - corners[i], corners[i + 4] - corners[i + 1], corners[i + 5] - corners[i + 2]];
      const [bx, by, bz] = [corners[i + 6] - corners[i], corners[i + 7] - corners[i + 1], corners[i + 8] - corners[i + 2]];
      const normal = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
      const length = Math.hypot(...normal) || 1;
      for (let c = 0; c < 9; c++) found[i + c] = normal[c % 3] / length;
    }
    return found;
  }
}

export function meshesOf(page) {
  return page.meshes.map((told) => new PageMesh(told, page.sections));
}
