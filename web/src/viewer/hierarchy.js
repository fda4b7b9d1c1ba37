// Bounding volume hierarchies of meshes, as shaders/transport/hierarchy.glsl walks through them: depth-first with skip
// links, in eight orders, and triangles three texels each. Built from the top down by the surface area heuristic in
// bins; any hierarchy gives the same hits as that of translucent/geometry/bvh.py.

const LEAF = 4;
const BINS = 16;
const STEPS = 65535;

/** Nodes: bounds, children, triangles; `order` lists triangles leaf by leaf. */
function tree(corners, count) {
  const boxes = new Float32Array(6 * count);
  const middle = new Float32Array(3 * count);
  for (let t = 0; t < count; t++) {
    for (let k = 0; k < 3; k++) {
      const [a, b, c] = [corners[9 * t + k], corners[9 * t + 3 + k], corners[9 * t + 6 + k]];
      boxes[6 * t + k] = Math.min(a, b, c);
      boxes[6 * t + 3 + k] = Math.max(a, b, c);
      middle[3 * t + k] = 0.5 * (boxes[6 * t + k] + boxes[6 * t + 3 + k]);
    }
  }
  const order = new Uint32Array(count).map((_, i) => i);
  const low = [], high = [], left = [], right = [], axis = [], first = [], held = [];
  const area = (b) => (b[3] - b[0]) * (b[4] - b[1]) + (b[3] - b[0] + b[4] - b[1]) * (b[5] - b[2]);
  const grow = (b, t) => {
    for (let k = 0; k < 3; k++) {
      if (boxes[6 * t + k] < b[k]) b[k] = boxes[6 * t + k];
      if (boxes[6 * t + 3 + k] > b[3 + k]) b[3 + k] = boxes[6 * t + 3 + k];
    }
  };
  const empty = () => [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
  const todo = [[0, count, -1, 0]];
  while (todo.length) {
    const [begin, end, parent, side] = todo.pop();
    const node = low.length / 3;
    const box = empty();
    const span = empty();
    for (let i = begin; i < end; i++) {
      grow(box, order[i]);
      for (let k = 0; k < 3; k++) {
        const x = middle[3 * order[i] + k];
        if (x < span[k]) span[k] = x;
        if (x > span[3 + k]) span[3 + k] = x;
      }
    }
    low.push(box[0], box[1], box[2]);
    high.push(box[3], box[4], box[5]);
    if (parent >= 0) (side ? right : left)[parent] = node;
    left.push(-1);
    right.push(-1);
    axis.push(0);
    first.push(begin);
    held.push(end - begin);
    if (end - begin <= LEAF) continue;
    let best = { cost: Infinity, at: -1, axis: 0 };
    for (let k = 0; k < 3; k++) {
      const extent = span[3 + k] - span[k];
      if (!(extent > 0)) continue;
      const bins = Array.from({ length: BINS }, () => ({ count: 0, box: empty() }));
      for (let i = begin; i < end; i++) {
        const bin = bins[Math.min(BINS - 1, Math.floor(((middle[3 * order[i] + k] - span[k]) / extent) * BINS))];
        bin.count++;
        grow(bin.box, order[i]);
      }
      const after = new Array(BINS);
      let sum = 0, whole = empty();
      const join = (b, c) => { for (let j = 0; j < 3; j++) { b[j] = Math.min(b[j], c[j]); b[3 + j] = Math.max(b[3 + j], c[3 + j]); } };
      for (let i = BINS - 1; i > 0; i--) {
        sum += bins[i].count;
        join(whole, bins[i].box);
        after[i] = sum ? sum * area(whole) : Infinity;
      }
      sum = 0;
      whole = empty();
      for (let i = 0; i + 1 < BINS; i++) {
        sum += bins[i].count;
        join(whole, bins[i].box);
        if (sum && sum < end - begin) {
          const cost = sum * area(whole) + after[i + 1];
          if (cost < best.cost) best = { cost, at: span[k] + (extent * (i + 1)) / BINS, axis: k, bin: i + 1, low: span[k], extent };
        }
      }
    }
    let split = (begin + end) >> 1;
    if (best.bin) {
      let i = begin, j = end - 1;
      const bin = (t) => Math.min(BINS - 1, Math.floor(((middle[3 * t + best.axis] - best.low) / best.extent) * BINS));
      while (i <= j) {
        if (bin(order[i]) < best.bin) {
          i++;
        } else {
          [order[i], order[j]] = [order[j], order[i]];
          j--;
        }
      }
      split = i;
    }
    axis[node] = best.axis;
    todo.push([split, end, node, 1], [begin, split, node, 0]);
  }
  return { low, high, left, right, axis, first, held, order, nodes: low.length / 3 };
}

/** Four words of a node as rays of an octant read it. */
function packed(found, at, low, high, node, octant, link) {
  const half = STEPS / 2;
  const near = [], far = [];
  for (let k = 0; k < 3; k++) {
    const a = Math.min(Math.max(Math.floor((low[3 * node + k] + 1) * half) - 1, 0), STEPS);
    const b = Math.min(Math.max(Math.ceil((high[3 * node + k] + 1) * half) + 1, 0), STEPS);
    const turned = (octant >> k) & 1;
    near.push(turned ? b : a);
    far.push(turned ? a : b);
  }
  found[4 * at] = (near[0] | (near[1] << 16)) >>> 0;
  found[4 * at + 1] = (near[2] | (far[0] << 16)) >>> 0;
  found[4 * at + 2] = (far[1] | (far[2] << 16)) >>> 0;
  found[4 * at + 3] = link;
}

/** Unit vector as 2 x 16 bits on an octahedron. */
function packedNormal(x, y, z) {
  const size = Math.abs(x) + Math.abs(y) + Math.abs(z) || 1;
  let [u, v] = [x / size, y / size];
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * (u >= 0 ? 1 : -1), (1 - Math.abs(u)) * (v >= 0 ? 1 : -1)];
  const step = (value) => Math.round((value + 1) * (STEPS / 2));
  return (step(u) | (step(v) << 16)) >>> 0;
}

/**
 * The hierarchy of a mesh: nodes in eight orders, and triangles, as words.
 * @returns {{nodes: Uint32Array, count: number, triangles: Uint32Array}}
 */
export function hierarchyOf(mesh) {
  const { offsets, faces } = mesh;
  const count = faces.length / 3;
  const extent = Math.max(...[0, 1, 2].map((k) => mesh.high[k] - mesh.low[k])) / 2;
  const scale = 1 / Math.max(extent, 1e-300);
  const corners = new Float32Array(9 * count);
  for (let i = 0; i < faces.length; i++) {
    for (let k = 0; k < 3; k++) corners[3 * i + k] = offsets[3 * faces[i] + k] * scale;
  }
  const { low, high, left, right, axis, first, held, order, nodes } = tree(corners, count);
  const size = new Uint32Array(nodes).fill(1);
  for (let i = nodes - 1; i >= 0; i--) if (left[i] >= 0) size[i] += size[left[i]] + size[right[i]];
  const found = new Uint32Array(4 * 8 * nodes);
  for (let octant = 0; octant < 8; octant++) {
    const base = octant * nodes;
    const todo = [[0, 0]];
    while (todo.length) {
      const [node, place] = todo.pop();
      const leaf = left[node] < 0;
      const link = leaf ? (0x80000000 | ((held[node] - 1) << 28) | first[node]) >>> 0 : place + size[node];
      packed(found, base + place, low, high, node, octant, link);
      if (leaf) continue;
      const swap = (octant >> axis[node]) & 1;
      const [near, far] = swap ? [right[node], left[node]] : [left[node], right[node]];
      todo.push([far, place + 1 + size[near]], [near, place + 1]);
    }
  }
  const triangles = new Uint32Array(12 * count);
  const bits = new Uint32Array(corners.buffer);
  for (let t = 0; t < count; t++) {
    const face = order[t];
    for (let c = 0; c < 3; c++) {
      const at = 4 * (3 * t + c);
      for (let k = 0; k < 3; k++) triangles[at + k] = bits[9 * face + 3 * c + k];
      const n = mesh.normal(3 * face + c);
      triangles[at + 3] = packedNormal(n[0], n[1], n[2]);
    }
  }
  return { nodes: found, count: nodes, triangles };
}

/**
 * Textures' words of a scene's hierarchies: nodes of objects, then those of meshes, then triangles from a new row on.
 * @param {Uint32Array} objectNodes nodes of the hierarchy of objects, with the room that is kept for them
 */
export function sceneHierarchies(meshes, objectNodes, width) {
  const parts = meshes.map(hierarchyOf);
  const rows = (texels) => Math.ceil(texels / width);
  let node = objectNodes.length / 4;
  const nodeRows = rows(node + parts.reduce((sum, part) => sum + 8 * part.count, 0));
  const triangleRows = rows(parts.reduce((sum, part) => sum + part.triangles.length / 4, 0));
  const words = new Uint32Array(4 * width * (nodeRows + triangleRows));
  words.set(objectNodes);
  let triangle = 0;
  const spans = parts.map((part) => {
    const span = { first: node, count: part.count };
    for (let octant = 0; octant < 8; octant++) {
      const own = part.nodes.subarray(4 * octant * part.count, 4 * (octant + 1) * part.count);
      words.set(own, 4 * node);
      for (let i = 4 * node + 3; i < 4 * (node + part.count); i += 4) words[i] += words[i] >= 0x80000000 ? triangle : node;
      node += part.count;
    }
    words.set(part.triangles, 4 * (nodeRows * width + 3 * triangle));
    triangle += part.triangles.length / 12;
    return span;
  });
  return { words, rows: nodeRows + triangleRows, triangleRow: nodeRows, spans };
}
