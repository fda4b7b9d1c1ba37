/** Places of bodies before a camera: in float64, rounded to float32 only relative to each body's center. */
import { Box3, Matrix4, Vector2, Vector3, Vector4 } from "three";
import type { Camera } from "three";
import { sumOfInstances } from "./bodies.js";
import type { StandIn } from "./bodies.js";
import { NEAR_SURFACE, NOTHING } from "./generated/shaders.js";
import type { BodyUniforms } from "./uniforms.js";
import { isClosed, windingNumber } from "./topology.js";

/** Distances along the camera's axis that media span. */
export interface DepthRange {
  near: number;
  length: number;
}

/** A camera as rays see it: no near plane, no far plane, whatever its depth buffer is. */
export interface View {
  camera: Camera;
  orthographic: boolean;
  /** Pixels of the picture. */
  width: number;
  height: number;
  /** Step of the grid onto which the rasterizer moves vertices, in pixels. */
  subpixel: number;
  /** Metres ahead of the camera at which rays start. */
  start: number;
  eye: Vector3;
  range(box: Box3): DepthRange;
  /** Left, bottom, width and height of a box in the picture, in pixels. */
  rectangle(box: Box3): [number, number, number, number];
  /** Rays of pixels, which advance 1 m along the camera's axis. */
  setRays(right: Vector4, up: Vector4, forward: Vector4): void;
}

export function seesFrom(camera: Camera, width: number, height: number, subpixel: number): View {
  const p = camera.projectionMatrix.elements;
  const orthographic = p[15] === 1;
  const start = orthographic ? ((camera as { near?: number }).near ?? 0) : 0;
  const corner = new Vector3();
  return {
    camera,
    orthographic,
    width,
    height,
    subpixel,
    start,
    eye: new Vector3().setFromMatrixPosition(camera.matrixWorld),
    range(box) {
      if (box.isEmpty()) return { near: 0, length: 1 };
      let [near, far] = [Infinity, -Infinity];
      for (let i = 0; i < 8; i++) {
        corner.set((i & 1 ? box.max : box.min).x, (i & 2 ? box.max : box.min).y, (i & 4 ? box.max : box.min).z);
        const ahead = -corner.applyMatrix4(camera.matrixWorldInverse).z;
        near = Math.min(near, ahead);
        far = Math.max(far, ahead);
      }
      near = Math.max(near, start);
      return { near, length: Math.max(far, start) - near || 1 };
    },
    rectangle(box) {
      const whole: [number, number, number, number] = [0, 0, width, height];
      const [least, most] = [new Vector2(Infinity, Infinity), new Vector2(-Infinity, -Infinity)];
      for (let i = 0; i < 8; i++) {
        corner.set((i & 1 ? box.max : box.min).x, (i & 2 ? box.max : box.min).y, (i & 4 ? box.max : box.min).z);
        corner.applyMatrix4(camera.matrixWorldInverse);
        if (!orthographic && !(corner.z < 0)) return whole;
        corner.applyMatrix4(camera.projectionMatrix);
        const pixel = new Vector2((corner.x + 1) * (width / 2), (corner.y + 1) * (height / 2));
        least.min(pixel);
        most.max(pixel);
      }
      if (![least.x, least.y, most.x, most.y].every(Number.isFinite)) return box.isEmpty() ? [0, 0, 0, 0] : whole;
      const [left, bottom] = [Math.max(Math.floor(least.x) - 1, 0), Math.max(Math.floor(least.y) - 1, 0)];
      const [right, top] = [Math.min(Math.ceil(most.x) + 1, width), Math.min(Math.ceil(most.y) + 1, height)];
      return [left, bottom, right - left, top - bottom];
    },
    setRays(right, up, forward) {
      right.set(orthographic ? 0 : 1 / p[0], 0, 0, 0);
      up.set(0, orthographic ? 0 : 1 / p[5], 0, 0);
      forward.set(orthographic ? 0 : p[8] / p[0], orthographic ? 0 : p[9] / p[5], -1, 0);
    },
  };
}

/** Of a body's size. By ten times less sound faces at outlines would stay uncorrected; see docs/notes/browsers.md. */
const LONGEST_CHANGE = 0.01;

const viewFromOffset = new Matrix4();
const low = new Vector3();
const high = new Vector3();

/** Set where a body is: from offsets to the picture, and to metres along the camera's axis from its center. */
export function place(one: StandIn, view: View, range: DepthRange): void {
  const { uniforms, box, mesh } = one;
  const center = box.getCenter(uniforms.center.value);
  center.set(Math.fround(center.x), Math.fround(center.y), Math.fround(center.z));
  viewFromOffset.makeTranslation(center.x, center.y, center.z).premultiply(mesh.matrixWorld);
  viewFromOffset.premultiply(view.camera.matrixWorldInverse);
  const clip = uniforms.clip_from_offset.value.multiplyMatrices(view.camera.projectionMatrix, viewFromOffset).elements;
  clip[2] = clip[6] = clip[10] = clip[14] = 0; // no depth: nothing is clipped but what is behind
  // Triangles through the eye itself have no image: they project to 0/0. Clip them just ahead of it, where z is w; that is
  // the far end of depths from -1 to 1 as from 0 to 1 (reversedDepthBuffer).
  if (!view.orthographic) clip[14] = NEAR_SURFACE * one.worldBox.getSize(low).length();
  const e = viewFromOffset.elements;
  const cut = isCut(one, view);
  uniforms.axis.value.set(-e[2], -e[6], -e[10], cut ? -e[14] : 0);
  setAnchor(uniforms, view, [clip[12], clip[13]], -e[14], cut);
  uniforms.axial_start.value = view.orthographic && cut ? view.start : -NOTHING;
  uniforms.ahead.value = cut ? 0 : -e[14];
  uniforms.world_from_normal.value.copy(mesh.matrixWorld).invert().transpose();
  uniforms.longest_change.value = LONGEST_CHANGE * one.worldBox.getSize(low).length();
  uniforms.axial_depth_scale.value = 1 / range.length;
  uniforms.axial_depth_start.value = ((cut ? 0 : -e[14]) - range.near) / range.length;
}

/** Set the point of the picture that places count from: the center of the body, or of the picture if that has no place. */
function setAnchor(uniforms: BodyUniforms, view: View, clip: [number, number], ahead: number, cut: boolean): void {
  const { orthographic, width, height } = view;
  const weight = orthographic || cut ? 1 : ahead;
  const [x, y] = cut && !orthographic ? [0, 0] : clip.map((c) => c / weight);
  const [right, up] = [(x + 1) * (width / 2), (y + 1) * (height / 2)];
  uniforms.anchor_pixel.value.set(Math.fround(right), Math.fround(up));
  uniforms.anchor_rest.value.set(right - Math.fround(right), up - Math.fround(up));
  uniforms.anchor_slope.value.set(orthographic ? 0 : x, orthographic ? 0 : y);
  uniforms.across_start.value.set(cut && !orthographic ? clip[0] : 0, cut && !orthographic ? clip[1] : 0);
  uniforms.half_size.value.set(width / 2, height / 2);
}

/** Tell whether rays may start within the bounds of a body: distances then count from there. */
export function isCut(one: StandIn, view: View): boolean {
  const { worldBox } = one;
  if (view.orthographic) return view.range(worldBox).near <= view.start;
  const margin = NEAR_SURFACE * worldBox.getSize(low).length();
  return worldBox.distanceToPoint(view.eye) <= margin;
}

/** Least and greatest signed count that a ray may have: the winding number at its origin. */
export function expectedCount(one: StandIn, view: View): [number, number] {
  // An orthographic ray is a whole line: it leaves a body as often as it enters, some of it behind the picture.
  if (view.orthographic || !isCut(one, view)) return [0, 0];
  const { mesh } = one;
  const matrix = mesh.matrixWorld;
  if (matrix.determinant() === 0) return [0, 0];
  const eye = high.copy(view.eye).applyMatrix4(matrix.clone().invert());
  const number = sumOfInstances(mesh, eye, (point) => windingNumber(mesh, point));
  const whole = Math.round(number);
  // On the surface, and where float32 cannot tell, a ray may start on either side of it.
  if (Math.abs(number - whole) < 1e-3 || !isClosed(mesh.geometry)) return [whole, whole];
  return [Math.max(Math.ceil(number) - 1, 0), Math.floor(number) + 1];
}
