/** Media of materials. */
import type { Color, Material, Mesh } from "three";

/** Extinction in 1/m, per channel: attenuationColor is left after attenuationDistance metres (Beer and Lambert). */
export function extinctionOf(material: Material): [number, number, number] {
  const medium = material as { attenuationColor?: Color; attenuationDistance?: number };
  const { attenuationColor: color, attenuationDistance: distance = Infinity } = medium;
  if (!color || distance === Infinity) return [0, 0, 0];
  // From black nothing is left, which a float can say of any length.
  return [color.r, color.g, color.b].map((c) => Math.min(-Math.log(Math.min(c, 1)) / distance, 1e30) + 0) as [number, number, number];
}

export function materials(mesh: Mesh): Material[] {
  return Array.isArray(mesh.material) ? mesh.material : [mesh.material];
}
