// Thickness in float64, without a grid: what pictures of rasterizers in software are checked by.

import { halfExtent, seenVertices } from "./blocks.js";

/** Pixels that rays are moved by, so that none meets an edge: thousands of times less than a grid of 1/256. */
const ASIDE = [1.3e-7, 0.7e-7];

/** Depths along the camera's axis and sides, 1 or -1, of the faces of a mesh before each pixel: `meet(pixel, depth, side)`. */
function cast(corners, faces, [width, height], meet) {
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => corners.subarray(4 * faces[f + k], 4 * faces[f + k] + 4));
    let [left, right, top, bottom] = [0, width - 1, 0, height - 1];
    if (a[2] > 0 && b[2] > 0 && c[2] > 0) {
      const [x, y, z] = [a[0] / a[2], b[0] / b[2], c[0] / c[2]], [p, q, r] = [a[1] / a[2], b[1] / b[2], c[1] / c[2]];
      left = Math.max(left, Math.floor(Math.min(x, y, z))), right = Math.min(right, Math.ceil(Math.max(x, y, z)));
      top = Math.max(top, Math.floor(Math.min(p, q, r))), bottom = Math.min(bottom, Math.ceil(Math.max(p, q, r)));
    } else if (a[2] <= 0 && b[2] <= 0 && c[2] <= 0) {
      continue;
    }
    if (left > right || top > bottom) continue;
    const [u, v, w] = [cross(b, c), cross(c, a), cross(a, b)];
    const side = Math.sign(u[0] * a[0] + u[1] * a[1] + u[2] * a[2]);
    for (let row = top; row <= bottom; row++) {
      for (let column = left; column <= right; column++) {
        const x = column + ASIDE[0], y = row + ASIDE[1];
        const p = side * (u[0] * x + u[1] * y + u[2]), q = side * (v[0] * x + v[1] * y + v[2]), r = side * (w[0] * x + w[1] * y + w[2]);
        if (p > 0 && q > 0 && r > 0) meet(row * width + column, (p * a[3] + q * b[3] + r * c[3]) / (p + q + r), side);
      }
    }
  }
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

const apart = ([low, high], [from, to]) => low.some((x, k) => x > to[k] || high[k] < from[k]);

/**
 * Metres inside bodies along the ray of each pixel, top row first; null where sums of signed distances are not what is
 * shown: of sheets, and of bodies that may overlap.
 */
export function exactThickness({ scene, meshes, variant, camera, size }) {
  const bodies = scene.objects.filter((body) => !body.opaque);
  if (variant.makes_sheets || bodies.some((body) => body.sheet)) return null;
  if (bodies.some((one, i) => bodies.some((other, k) => k < i && !apart(one.bounds, other.bounds)))) return null;
  const pixels = size[0] * size[1];
  const end = new Float64Array(pixels).fill(Infinity), found = new Float64Array(pixels);
  for (const body of scene.objects) {
    if (body.opaque) {
      cast(seenVertices(body, meshes[body.mesh], camera, size), meshes[body.mesh].faces, size, (pixel, depth) => {
        if (depth > 0) end[pixel] = Math.min(end[pixel], depth);
      });
    }
  }
  for (const body of bodies) {
    const sums = new Float64Array(pixels);
    cast(seenVertices(body, meshes[body.mesh], camera, size), meshes[body.mesh].faces, size, (pixel, depth, side) => {
      sums[pixel] += side * Math.min(Math.max(depth, 0), end[pixel]);
    });
    for (let i = 0; i < pixels; i++) found[i] += Math.abs(sums[i]); // wound either way
  }
  const half = halfExtent(camera, size);
  for (let i = 0; camera.fov_y != null && i < pixels; i++) {
    const x = (2 * ((i % size[0]) + 0.5)) / size[0] - 1, y = (2 * (Math.floor(i / size[0]) + 0.5)) / size[1] - 1;
    found[i] *= Math.hypot(1, x * half[0], y * half[1]);
  }
  return found;
}
