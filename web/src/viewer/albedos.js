// Light of a scattering medium at other albedos, as translucent/page/albedos.py puts it down: its `changed` in numbers.

const variable = (albedo) => Math.sqrt(1 - albedo);

/** Value of a table, at even steps of sqrt(1 - albedo), between its entries. */
function between(table, width, column, albedo, least) {
  const count = table.length / width;
  const at = (variable(albedo) / variable(least)) * (count - 1);
  const first = Math.min(Math.max(Math.floor(at), 0), count - 2);
  const part = at - first;
  return (1 - part) * table[width * first + column] + part * table[width * (first + 1) + column];
}

/** Reflectance of thick parts in white light for each albedo. */
export function reflectanceOf(told, albedo) {
  return albedo.map((x) => between(told.reflectance, 1, 0, Math.max(x, told.least), told.least));
}

/** Albedo for each reflectance; at the bounds where there is none. */
export function albedoOf(told, reflectance) {
  const table = told.reflectance; // falls from albedo 1 on
  return reflectance.map((wanted) => {
    if (wanted >= table[0]) return 1;
    let i = table.findIndex((x) => x < wanted);
    if (i < 0) return told.least;
    const s = (i - (wanted - table[i]) / (table[i - 1] - table[i])) / (table.length - 1);
    return 1 - (s * variable(told.least)) ** 2;
  });
}

/** Absorption and scattering in 1/m of a medium with an albedo, and its full extinction. */
export function mediumOf(told, albedo) {
  const scattering = albedo.map((x, c) => (x * told.extinction[c]) / (1 - told.anisotropy));
  const absorption = albedo.map((x, c) => (1 - x) * told.extinction[c]);
  return { absorption, scattering, extinction: scattering.map((x, c) => x + absorption[c]) };
}

/** First of two coarse cells around each of `fine` ones, and the weight of the second. */
function places(fine, few, coarser) {
  return Array.from({ length: fine }, (_, i) => {
    const at = Math.min(Math.max((i + 0.5) / coarser - 0.5, 0), few - 1);
    const first = Math.min(Math.floor(at), Math.max(few - 2, 0));
    return [first, Math.min(first + 1, few - 1), at - first];
  });
}

/** Functions over coarse cells summed up for three channels: (sides, z, y, x, 3). */
function summed(block, told, before, after, sections) {
  const basis = new Int8Array(sections[block.basis].buffer), steps = sections[block.steps];
  const [rank] = sections[block.basis].shape;
  const size = basis.length / rank;
  const found = new Float32Array(size);
  for (let r = 0; r < rank; r++) {
    const weights = after.map((x, c) => between(steps, rank, r, x, told.least) - between(steps, rank, r, before[c], told.least));
    for (let i = 0; i < size; i++) found[i] += weights[i % 3] * basis[r * size + i];
  }
  return found;
}

/**
 * Texels of diffused light (layers, height, width, 4) at another albedo.
 * @param {Float32Array} texels at the albedo that the page was written with
 */
export function changedLight(told, texels, [width, height], after, sections) {
  const before = told.albedo, found = Float32Array.from(texels);
  for (const block of told.blocks) {
    const coarse = summed(block, told, before, after, sections);
    const [, sides, few_z, few_y, few_x] = sections[block.basis].shape;
    const [size_x, size_y, size_z] = block.size;
    const [xs, ys, zs] = [[size_x, few_x], [size_y, few_y], [size_z, few_z]].map(([n, few]) => places(n, few, told.coarser));
    const factor = after.map((x, c) => x / before[c]);
    for (let side = 0; side < sides; side++) {
      const left = (side % 2) * size_x, top = Math.floor(side / 2) * size_y;
      for (let z = 0; z < size_z; z++) {
        for (let y = 0; y < size_y; y++) {
          const rows = [zs[z][0], zs[z][1]].flatMap((k) => [ys[y][0], ys[y][1]].map((j) => ((side * few_z + k) * few_y + j) * few_x));
          const [v, w] = [ys[y][2], zs[z][2]];
          const weights = [(1 - v) * (1 - w), v * (1 - w), (1 - v) * w, v * w];
          let at = 4 * (((block.layer + z) * height + top + y) * width + left);
          for (let x = 0; x < size_x; x++, at += 4) {
            const [a, b, u] = xs[x];
            for (let c = 0; c < 3; c++) {
              if (block.logarithmic && found[at + c] === 0) continue;
              let change = 0;
              for (let k = 0; k < 4; k++) {
                change += weights[k] * ((1 - u) * coarse[3 * (rows[k] + a) + c] + u * coarse[3 * (rows[k] + b) + c]);
              }
              found[at + c] = block.logarithmic ? found[at + c] * factor[c] * Math.exp(change) : found[at + c] + change;
            }
          }
        }
      }
    }
  }
  return found;
}

/** Fractions of mirrored light scattered ahead that leave where a ray does, and on the other side: see `in_scattered_shares`. */
export function aheadShares(mirror, absorption, thickness) {
  return absorption.map((sigma) => {
    const passed = Math.exp(-2 * sigma * thickness);
    const near = (passed * (1 - mirror)) / (1 - (mirror * passed) ** 2);
    return [mirror * passed * near, near];
  });
}
