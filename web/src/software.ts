/** Rasterizers in software: how they are known, and how much finer faces are drawn on them. */
import { TranslucentError } from "./errors.js";

/** Pixels along each side of a pixel that faces may be drawn into. */
export const REFINEMENTS = [1, 3, 5];

const NAMES = /swiftshader|llvmpipe|lavapipe|softpipe|microsoft basic/i;

/** True if a browser names a rasterizer in software. */
export const isSoftware = (...names: (string | undefined)[]): boolean => NAMES.test(names.join(" "));

/** True if WebGL draws in software. */
export function drawsInSoftware(gl: WebGL2RenderingContext): boolean {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  return isSoftware(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER) as string);
}

/**
 * Pixels along each side of a pixel that faces are drawn into: those that were requested, else 3 in software and 1 on graphics
 * cards; 1 as well where a texture of at most `most` pixels does not hold three times the size.
 */
export function refinementOf(requested: number | undefined, software: boolean, size: number[], most: number, of: string): number {
  const fits = (refine: number): boolean => Math.max(...size) * refine <= most;
  if (requested === undefined) return software && fits(3) ? 3 : 1;
  if (requested > 1 && !fits(requested)) {
    const fine = size.map((n) => n * requested).join(" x ");
    throw new TranslucentError(`${of} with refine: ${requested}`, `${fine} pixels are more than the ${most} of this graphics card`, "refine less, or set a smaller size");
  }
  return requested;
}
