/** Topology of a geometry: closed or not, and how often it winds around a point. In float64, on the CPU. */
import { Vector3 } from "three";
import type { BufferGeometry, Mesh } from "three";

/** Indices of the corners of all triangles that are drawn. */
export function corners(geometry: BufferGeometry): { count: number; at: (i: number) => number } {
  const { index, drawRange } = geometry;
  const all = index ? index.count : (geometry.getAttribute("position")?.count ?? 0);
  const start = Math.max(drawRange.start, 0);
  const count = Math.max(Math.min(all - start, drawRange.count), 0);
  return { count: count - (count % 3), at: index ? (i) => index.getX(start + i) : (i) => start + i };
}

const known = new WeakMap<BufferGeometry, { key: string; closed: boolean }>();

/**
 * Tell whether every edge has two faces that are wound alike; vertices at one place are one vertex. Kept with the geometry until
 * its positions, its index or its range change.
 */
export function isClosed(geometry: BufferGeometry): boolean {
  const position = geometry.getAttribute("position") as { version?: number; data?: { version: number }; count: number };
  const { index, drawRange } = geometry;
  const version = position.version ?? position.data?.version ?? 0;
  const key = [version, position.count, index?.version, index?.count, drawRange.start, drawRange.count].join();
  const found = known.get(geometry);
  if (found?.key === key) return found.closed;
  const closed = findClosed(geometry);
  known.set(geometry, { key, closed });
  return closed;
}

function findClosed(geometry: BufferGeometry): boolean {
  const { count, at } = corners(geometry);
  const vertex = welded(geometry);
  const edges = new Map<number, number>();
  const n = geometry.getAttribute("position").count;
  for (let i = 0; i < count; i += 3) {
    const face = [vertex[at(i)], vertex[at(i + 1)], vertex[at(i + 2)]];
    for (let k = 0; k < 3; k++) {
      const [a, b] = [face[k], face[(k + 1) % 3]];
      if (a === b) continue; // a corner that has no size
      const edge = a < b ? a * n + b : b * n + a;
      const sum = (edges.get(edge) ?? 0) + (a < b ? 1 : -1);
      if (sum) edges.set(edge, sum);
      else edges.delete(edge);
    }
  }
  return edges.size === 0;
}

/** For each vertex the first one at its place. */
function welded(geometry: BufferGeometry): Int32Array {
  const position = geometry.getAttribute("position");
  const n = position.count;
  const size = 2 ** Math.ceil(Math.log2(2 * n + 1));
  const table = new Int32Array(size).fill(-1);
  const first = new Int32Array(n);
  // To the last digit of the largest coordinate: where a sphere closes, sin(2 pi) is no 0.
  if (!geometry.boundingBox) geometry.computeBoundingBox();
  const { min, max } = geometry.boundingBox!;
  const large = 2 * Math.max(...[...min.toArray(), ...max.toArray()].map(Math.abs));
  const rounded = (x: number): number => Math.fround(Math.fround(x + large) - large);
  const bits = new Float32Array(3);
  const words = new Int32Array(bits.buffer);
  const places = new Float32Array(3 * n);
  for (let i = 0; i < n; i++) {
    bits[0] = rounded(position.getX(i));
    bits[1] = rounded(position.getY(i));
    bits[2] = rounded(position.getZ(i));
    places.set(bits, 3 * i);
    let slot = (Math.imul(words[0], 73856093) ^ Math.imul(words[1], 19349663) ^ Math.imul(words[2], 83492791)) >>> 0;
    slot = (slot ^ (slot >>> 15)) & (size - 1);
    while (table[slot] >= 0) {
      const j = 3 * table[slot];
      if (places[j] === bits[0] && places[j + 1] === bits[1] && places[j + 2] === bits[2]) break;
      slot = (slot + 1) & (size - 1);
    }
    if (table[slot] < 0) table[slot] = i;
    first[i] = table[slot];
  }
  return first;
}

/**
 * Winding number of a mesh around a point in its own coordinates, as it is posed now: the solid angle of its faces over 4 pi
 * (van Oosterom and Strackee 1983). 1 inside, 0 outside, between them on the surface.
 */
export function windingNumber(mesh: Mesh, point: Vector3): number {
  const { count, at } = corners(mesh.geometry);
  const [a, b, c, cross] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
  let sum = 0;
  for (let i = 0; i < count; i += 3) {
    mesh.getVertexPosition(at(i), a).sub(point);
    mesh.getVertexPosition(at(i + 1), b).sub(point);
    mesh.getVertexPosition(at(i + 2), c).sub(point);
    const [la, lb, lc] = [a.length(), b.length(), c.length()];
    const volume = a.dot(cross.crossVectors(b, c));
    const rest = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    if (volume !== 0 || rest < 0) sum += 2 * Math.atan2(volume, rest);
  }
  return sum / (4 * Math.PI);
}
