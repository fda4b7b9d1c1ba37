// Contents of the uniform blocks for a camera, in float64 as translucent/gpu/{placement,body_uniforms,uniforms}.py work it out.
// Fields that depend neither on the camera nor on the material are those that the page came with.

const NOTHING = 1e30;
const NEAR_SURFACE = 1e-6;
const ROUNDING = 1e-5;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const norm = (a) => Math.hypot(a[0], a[1], a[2]);
const linear = (m, v) => [0, 1, 2].map((i) => m[4 * i] * v[0] + m[4 * i + 1] * v[1] + m[4 * i + 2] * v[2]);
const column = (m) => [m[3], m[7], m[11]];

/** Half width and half height of the view: at distance 1 in perspective, else in metres. */
export function halfExtent(camera, size) {
  const half = camera.fov_y == null ? camera.height / 2 : Math.tan((camera.fov_y * Math.PI) / 360);
  return [(half * size[0]) / size[1], half];
}

function corners(low, high) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? high : low)[axis]));
}

/** Nearest and farthest axial distance of objects from the eye. */
function axialRange(objects, camera) {
  let [near, far, most] = [Infinity, -Infinity, 0];
  for (const { bounds } of objects) {
    for (const corner of corners(bounds[0], bounds[1])) {
      const depth = dot(minus(corner, camera.eye), camera.forward);
      near = Math.min(near, depth);
      far = Math.max(far, depth);
    }
  }
  most = Math.max(Math.abs(near), Math.abs(far));
  near = Math.max(near, 0);
  const length = Math.max(far, 0) - near || most || 1;
  return { near, far: near + length, length };
}

/** Winding number of a mesh around a point of its object (van Oosterom & Strackee 1983). */
function windingNumber(mesh, point) {
  const { offsets, faces, center } = mesh;
  const p = minus(point, center);
  let sum = 0;
  const corner = (i) => [offsets[3 * i] - p[0], offsets[3 * i + 1] - p[1], offsets[3 * i + 2] - p[2]];
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [corner(faces[f]), corner(faces[f + 1]), corner(faces[f + 2])];
    const [la, lb, lc] = [norm(a), norm(b), norm(c)];
    const triple =
      a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    const lengths = la * lb * lc;
    if (Math.abs(triple) <= 16 * Number.EPSILON * lengths) continue;
    sum += Math.atan2(triple, lengths + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return sum / (2 * Math.PI);
}

function solved(m, v) {
  const [a, b, c, d, e, f, g, h, i] = [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]];
  const det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
  return [
    ((e * i - f * h) * v[0] + (c * h - b * i) * v[1] + (b * f - c * e) * v[2]) / det,
    ((f * g - d * i) * v[0] + (a * i - c * g) * v[1] + (c * d - a * f) * v[2]) / det,
    ((d * h - e * g) * v[0] + (b * g - a * h) * v[1] + (a * e - b * d) * v[2]) / det,
  ];
}

/** Signed counts that rays from the eye may have. */
function expectedCount(body, mesh, camera) {
  if (body.sheet || camera.fov_y == null) return [0, 0];
  const local = solved(body.matrix, minus(camera.eye, column(body.matrix)));
  if (local.some((x, k) => x < mesh.low[k] || x > mesh.high[k])) return [0, 0];
  const number = (body.inverted ? -1 : 1) * windingNumber(mesh, local);
  return [Math.round(number), Math.round(number)];
}

function placement(body, mesh, camera) {
  const anchor = plus(linear(body.matrix, mesh.center), minus(column(body.matrix), camera.eye));
  const [low, high] = body.bounds.map((corner) => minus(corner, camera.eye));
  let cut;
  if (camera.fov_y == null) {
    cut = [0, 1, 2].reduce((sum, k) => sum + (camera.forward[k] > 0 ? low[k] : high[k]) * camera.forward[k], 0) < 0;
  } else {
    const margin = NEAR_SURFACE * norm(minus(high, low));
    cut = low.every((x) => x <= margin) && high.every((x) => x >= -margin);
  }
  const expected = cut && !body.opaque ? expectedCount(body, mesh, camera) : [0, 0];
  return { anchor, cut, expected };
}

/** Nearest and farthest distance that a depth buffer would hold is of no use here: what is drawn never writes it so. */

/** Views into the bytes of a block, by the names of its fields. */
export function fieldsOf(layout, buffer, offset = 0) {
  const fields = {};
  for (const [name, [start, kind, count]] of Object.entries(layout.fields)) {
    const View = kind === "i4" ? Int32Array : Float32Array;
    fields[name] = new View(buffer, offset + start, count);
  }
  return fields;
}

/**
 * The scene placed before a camera.
 * @returns {{placements: object[], media: object, opaque: object | null, inside: boolean}}
 */
export function placed(scene, meshes, camera) {
  const placements = scene.objects.map((body) => placement(body, meshes[body.mesh], camera));
  const bodies = scene.objects.filter((body) => !body.opaque);
  const opaque = scene.objects.filter((body) => body.opaque);
  return {
    placements,
    media: axialRange(bodies, camera),
    opaque: opaque.length ? axialRange(opaque, camera) : null,
    inside: placements.some((item) => item.expected[1] > 0),
  };
}

function viewBlock(fields, camera, size, shift, { media, opaque }) {
  const [halfWidth, halfHeight] = halfExtent(camera, size);
  const perspective = camera.fov_y == null ? 0 : 1;
  fields.frame_size.set([size[0], size[1], shift[0], shift[1]]);
  fields.ray_right.set([...times(camera.right, halfWidth * perspective), 0]);
  fields.ray_up.set([...times(camera.up, halfHeight * perspective), 0]);
  fields.ray_forward.set([...camera.forward, 0]);
  fields.opaque_range.set(opaque ? [(opaque.near - media.near) / media.length, media.length / opaque.length] : [0, 0]);
}

function bodyBlock(fields, body, mesh, role, placing, camera, size, shift, media, subpixel, diagonal) {
  const { anchor, cut, expected } = placing;
  const axes = [camera.right, camera.up, camera.forward];
  const m = body.matrix;
  const seen = axes.map((axis) => [
    ...[0, 1, 2].map((k) => axis[0] * m[k] + axis[1] * m[4 + k] + axis[2] * m[8 + k]),
    dot(axis, anchor),
  ]);
  const axis = [...seen[2]];
  if (role.anchored && !cut) axis[3] = 0;
  const start = seen[2][3] - axis[3];
  const [halfWidth, halfHeight] = halfExtent(camera, size);
  const w = camera.fov_y == null ? [0, 0, 0, 1] : seen[2];
  const onSurface = expected[0] !== expected[1];
  fields.clip_from_offset.set([
    ...seen[0].map((x, k) => x / halfWidth - ((2 * shift[0]) / size[0]) * w[k]),
    ...seen[1].map((x, k) => x / halfHeight + ((2 * shift[1]) / size[1]) * w[k]),
    0, 0, 0, onSurface ? -NEAR_SURFACE * mesh.diagonal : 0,
    ...w,
  ]);
  fields.eye_from_offset.set([
    m[0], m[1], m[2], anchor[0], m[4], m[5], m[6], anchor[1], m[8], m[9], m[10], anchor[2], 0, 0, 0, 1,
  ]);
  fields.axis.set(axis);
  fields.axial_start[0] = camera.fov_y == null && cut ? 0 : -NOTHING;
  fields.axial_depth_scale[0] = 1 / media.length;
  fields.axial_depth_start[0] = (start - media.near) / media.length;
  fields.starts_unknown[0] = onSurface ? 1 : 0;
  if (role.subpixel > 0) {
    fields.subpixel[0] = subpixel;
    fields.snapping_share[0] = subpixel / diagonal;
  }
}

function surfacesBlock(fields, scene, camera, size, media) {
  const [halfWidth, halfHeight] = halfExtent(camera, size);
  const center = minus(scene.center, camera.eye);
  const ahead = dot(center, camera.forward);
  const [low, high] = scene.bounds.map((corner) => minus(corner, camera.eye));
  const farthest = [0, 1, 2].reduce(
    (sum, k) => sum + Math.max(low[k] * camera.forward[k], high[k] * camera.forward[k]), 0);
  fields.surface_right.set([...times(camera.right, halfWidth), camera.fov_y == null ? 0 : 1]);
  fields.surface_up.set([...times(camera.up, halfHeight), 0]);
  fields.surface_off_axis.set([...minus(center, times(camera.forward, ahead)), 0]);
  fields.surface_ahead.set([media.near - ahead, media.length, ahead, farthest - ahead]);
  fields.surface_eye_axial_depth[0] = -media.near / media.length;
}

/** Vertices of an object, four numbers each: column and row of the picture, both times w, then w, then depth along the camera's axis. */
export function seenVertices(body, mesh, camera, size) {
  const [halfWidth, halfHeight] = halfExtent(camera, size);
  const anchor = plus(linear(body.matrix, mesh.center), minus(column(body.matrix), camera.eye));
  const found = new Float64Array((4 * mesh.offsets.length) / 3);
  for (let i = 0, k = 0; i < mesh.offsets.length; i += 3, k += 4) {
    const at = plus(linear(body.matrix, [mesh.offsets[i], mesh.offsets[i + 1], mesh.offsets[i + 2]]), anchor);
    const depth = dot(camera.forward, at), w = camera.fov_y == null ? 1 : depth;
    found[k] = (dot(camera.right, at) / halfWidth + w) * (size[0] / 2) - 0.5 * w;
    found[k + 1] = (w - dot(camera.up, at) / halfHeight) * (size[1] / 2) - 0.5 * w;
    found[k + 2] = w;
    found[k + 3] = depth;
  }
  return found;
}

/** Write all blocks of a variant of the page's frame for a camera, a size and a shift (right, down) in pixels. */
export function writeBlocks({ scene, meshes, variant, blocks, bodies, camera, size, shift, subpixel }) {
  const where = placed(scene, meshes, camera);
  const { placements, media } = where;
  viewBlock(blocks.View, camera, size, shift, where);
  scene.objects.forEach((body, i) => {
    const role = variant.roles[i];
    bodyBlock(bodies[i], body, meshes[body.mesh], role, placements[i], camera, size, shift, media, subpixel,
      scene.diagonal);
  });
  if (blocks.Surfaces) surfacesBlock(blocks.Surfaces, scene, camera, size, media);
  const pairs = placements.map((item, i) => item.expected.map((n) => n * variant.roles[i].weight));
  if (blocks.Shade) {
    const sheets = variant.makes_sheets;
    blocks.Shade.expected_count.set(sheets ? [0, 0] : [0, 1].map((k) => pairs.reduce((sum, pair) => sum + pair[k], 0)));
    if (variant.counts_from_camera) {
      const farthest = Math.max(...placements.map((item) => norm(item.anchor)));
      blocks.Shade.rounding[0] = ROUNDING * (scene.diagonal + farthest);
    }
  }
  if (blocks.Media) {
    blocks.Media.media_length[0] = media.length;
    variant.slots.forEach((objects, i) => {
      blocks.Media.slot_extinction[4 * i + 3] = objects.reduce((sum, k) => sum + placements[k].expected[0], 0);
      blocks.Media.slot_emission[4 * i + 3] = objects.reduce((sum, k) => sum + placements[k].expected[1], 0);
    });
  }
  return where;
}
