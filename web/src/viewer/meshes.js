// Meshes of a page: what it came with, and what is made of it when a pass asks.

/** Each corner's own value of a vertex attribute. */
function ofCorners(values, width, index) {
  const found = new Float32Array(index.length * width);
  for (let i = 0; i < index.length; i++) {
    for (let k = 0; k < width; k++) found[width * i + k] = values[width * index[i] + k];
  }
  return found;
}

/** Places between 0 and 1, closer together towards a middle. */
function knots(middle) {
  const found = [];
  for (let k = -RINGS; k <= RINGS; k++) {
    const at = k === 0 ? 0 : Math.sign(k) * NEARER ** (RINGS - Math.abs(k));
    found.push(at < 0 ? middle + middle * at : middle + (1 - middle) * at);
  }
  return found;
}

const RINGS = 28, NEARER = 0.8;

/**
 * Corners of a parallelogram of two triangles cut into many: rasterizers that clip triangles put new corners down on
 * their grid of a part of a pixel, and shift a plane that reaches far beyond the picture.
 * @returns {{corner: number[], weights: number[]}[] | null} for each new corner weights of the corners of face 0
 */
function cut(mesh) {
  const { faces, offsets } = mesh;
  if (faces.length !== 6) return null;
  const own = [...faces.subarray(0, 3)], other = [...faces.subarray(3)];
  const far = other.find((i) => !own.includes(i));
  const lone = own.findIndex((i) => !other.includes(i));
  if (far == null || lone < 0) return null;
  const [a, b, c] = [own[lone], own[(lone + 1) % 3], own[(lone + 2) % 3]];
  const at = (i, k) => offsets[3 * i + k];
  const extent = Math.max(...offsets.map(Math.abs));
  if ([0, 1, 2].some((k) => Math.abs(at(b, k) + at(c, k) - at(a, k) - at(far, k)) > 1e-6 * extent)) return null;
  const [us, vs] = [knots(0.5), knots(0.5)];
  const found = [];
  for (let i = 0; i + 1 < us.length; i++) {
    for (let j = 0; j + 1 < vs.length; j++) {
      const [p, q, r, s] = [[us[i], vs[j]], [us[i + 1], vs[j]], [us[i + 1], vs[j + 1]], [us[i], vs[j + 1]]];
      found.push(p, q, r, p, r, s);
    }
  }
  return { places: found, a, b, c, lone };
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

/** A mesh as it is drawn: that of two triangles as many, with the attributes of its corners between them. */
class CutMesh {
  constructor(mesh, { places, lone }) {
    this.mesh = mesh;
    this.places = places;
    this.order = [lone, (lone + 1) % 3, (lone + 2) % 3];
    this.faces = new Uint32Array(places.length).map((_, i) => i);
  }

  #between(values, width) {
    const [a, b, c] = this.order.map((corner) => width * corner);
    const found = new Float32Array(width * this.places.length);
    this.places.forEach(([u, v], i) => {
      for (let k = 0; k < width; k++) {
        found[width * i + k] = values[a + k] + u * (values[b + k] - values[a + k]) + v * (values[c + k] - values[a + k]);
      }
    });
    return found;
  }

  get offsets() { return this.#between(this.mesh.corners, 3); }
  get corners() { return this.offsets; }
  get cornerNormals() { return this.#between(this.mesh.cornerNormals, 3); }
  get flatNormals() { return this.#between(this.mesh.flatNormals, 3); }
  get cornerUv() { return this.#between(this.mesh.cornerUv, 2); }
  get cornerColors() { return this.#between(this.mesh.cornerColors, 4); }
}

/** Mesh that has the attributes to draw. */
export function drawn(mesh) {
  const parts = cut(mesh);
  return parts ? new CutMesh(mesh, parts) : mesh;
}

export function meshesOf(page) {
  return page.meshes.map((told) => new PageMesh(told, page.sections));
}
