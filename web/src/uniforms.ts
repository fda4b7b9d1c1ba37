/** Where a body is, as shaders have it. */
import { Matrix4, Vector2, Vector3, Vector4 } from "three";
import type { IUniform, Texture } from "three";
import { NOTHING } from "./generated/shaders.js";

/** Uniforms of one body: fields of the block Body that its shaders use. */
export interface BodyUniforms {
  [name: string]: IUniform;
  clip_from_offset: IUniform<Matrix4>;
  axis: IUniform<Vector4>;
  half_size: IUniform<Vector2>;
  /** Pixel from which places in the picture count, and what its float32 leaves out. */
  anchor_pixel: IUniform<Vector2>;
  anchor_rest: IUniform<Vector2>;
  anchor_slope: IUniform<Vector2>;
  across_start: IUniform<Vector2>;
  center: IUniform<Vector3>;
  axial_start: IUniform<number>;
  axial_depth_scale: IUniform<number>;
  axial_depth_start: IUniform<number>;
  count_weight: IUniform<number>;
  count_offset: IUniform<number>;
  snapping_share: IUniform<number>;
  /** Metres by which places on rays are corrected at most. */
  longest_change: IUniform<number>;
  extinction: IUniform<Vector4>;
  opaque_axial_depth: IUniform<Texture | null>;
  opaque_range: IUniform<Vector2>;
  world_from_normal: IUniform<Matrix4>;
  /** Metres ahead of the eye that `axial` counts from. */
  ahead: IUniform<number>;
}

export function bodyUniforms(): BodyUniforms {
  return {
    clip_from_offset: { value: new Matrix4() },
    axis: { value: new Vector4() },
    half_size: { value: new Vector2() },
    anchor_pixel: { value: new Vector2() },
    anchor_rest: { value: new Vector2() },
    anchor_slope: { value: new Vector2() },
    across_start: { value: new Vector2() },
    center: { value: new Vector3() },
    axial_start: { value: -NOTHING },
    axial_depth_scale: { value: 1 },
    axial_depth_start: { value: 0 },
    count_weight: { value: 1 },
    count_offset: { value: 0 },
    snapping_share: { value: 0 },
    longest_change: { value: 0 },
    extinction: { value: new Vector4() },
    opaque_axial_depth: { value: null },
    opaque_range: { value: new Vector2(0, 1) },
    world_from_normal: { value: new Matrix4() },
    ahead: { value: 0 },
  };
}
