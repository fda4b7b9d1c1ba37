// The camera of a viewer: three.js turns it, and the passes get its axes in float64.

import { OrthographicCamera, PerspectiveCamera, Spherical, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

export class View {
  /**
   * @param {object} scene of the page
   * @param {HTMLElement} element what pointers turn it on
   * @param {() => void} changed
   */
  constructor(scene, element, changed) {
    this.scene = scene;
    this.start = scene.camera;
    this.changed = changed;
    const { eye, forward } = this.start;
    const ahead = dot(scene.center.map((x, k) => x - eye[k]), forward);
    this.distance = ahead > 0 ? ahead : scene.diagonal;
    this.three = this.start.fov_y == null ? new OrthographicCamera() : new PerspectiveCamera();
    const upright = Math.abs(this.start.right[1]) < 1e-3;
    this.three.up.set(...(upright ? [0, 1, 0] : this.start.up));
    this.three.near = 1e-4 * scene.diagonal;
    this.three.far = 1e4 * scene.diagonal;
    this.controls = new OrbitControls(this.three, element);
    this.controls.zoomToCursor = true;
    this.controls.minDistance = 0.02 * scene.diagonal;
    this.controls.maxDistance = 40 * scene.diagonal + this.distance;
    this.height = this.start.height;
    this.reset();
    this.controls.addEventListener("change", () => {
      this.moved = true;
      changed();
    });
  }

  reset() {
    const { eye, forward } = this.start;
    this.three.position.set(...eye);
    this.controls.target.set(...eye.map((x, k) => x + this.distance * forward[k]));
    this.three.zoom = 1;
    this.controls.update();
    this.moved = false;
    this.changed();
  }

  set({ eye, target, up }) {
    if (up) this.three.up.set(...up);
    if (eye) this.three.position.set(...eye);
    if (target) this.controls.target.set(...target);
    this.controls.update();
    this.moved = true;
    this.changed();
  }

  /** Turn about the target, in radians. */
  turn(right, up) {
    const offset = this.three.position.clone().sub(this.controls.target);
    const pole = new Vector3(0, 1, 0);
    const turned = offset.clone();
    const up3 = this.three.up.clone().normalize();
    // Spherical angles count about +Y: turn the view there and back.
    const axis = new Vector3().crossVectors(up3, pole);
    const angle = up3.angleTo(pole);
    if (axis.lengthSq() > 1e-12) turned.applyAxisAngle(axis.normalize(), angle);
    const around = new Spherical().setFromVector3(turned);
    around.theta -= right;
    around.phi -= up;
    around.makeSafe();
    turned.setFromSpherical(around);
    if (axis.lengthSq() > 1e-12) turned.applyAxisAngle(axis, -angle);
    this.three.position.copy(this.controls.target).add(turned);
    this.#moved();
  }

  /** Move closer by a factor. */
  zoom(factor) {
    if (this.three.isOrthographicCamera) {
      this.three.zoom /= factor;
    } else {
      const offset = this.three.position.clone().sub(this.controls.target).multiplyScalar(factor);
      const length = Math.min(Math.max(offset.length(), this.controls.minDistance), this.controls.maxDistance);
      this.three.position.copy(this.controls.target).add(offset.setLength(length));
    }
    this.#moved();
  }

  /** Move sideways by shares of the height of the picture. */
  pan(right, up) {
    const { right: x, up: y } = this.camera();
    const height = 2 * Math.tan((this.start.fov_y ?? 30) * Math.PI / 360) * this.three.position.distanceTo(this.controls.target);
    const by = x.map((value, k) => height * (right * value + up * y[k]));
    this.three.position.add(new Vector3(...by));
    this.controls.target.add(new Vector3(...by));
    this.#moved();
  }

  #moved() {
    this.controls.update();
    this.moved = true;
    this.changed();
  }

  /** Position, axes and extent; `widen` makes the field of view so many times as high. */
  camera(widen = 1) {
    let { eye, right, up, forward } = this.start;
    if (this.moved) {
      eye = this.three.position.toArray();
      const backward = unit(eye.map((x, k) => x - this.controls.target.toArray()[k]));
      right = unit(cross(this.three.up.toArray(), backward));
      up = cross(backward, right);
      forward = backward.map((x) => -x);
    }
    const { fov_y } = this.start;
    return {
      eye, right, up, forward,
      fov_y: fov_y == null ? null : (360 / Math.PI) * Math.atan(widen * Math.tan((fov_y * Math.PI) / 360)),
      height: fov_y == null ? (widen * this.start.height) / this.three.zoom : null,
    };
  }

  /** Factor by which the view is higher in a picture this narrow, so that all bodies that were seen at first are. */
  widened(size) {
    const { eye, right, forward, fov_y, height } = this.start;
    const half = fov_y == null ? height / 2 : Math.tan((fov_y * Math.PI) / 360);
    const whole = (half * this.scene.size[0]) / this.scene.size[1];
    let reach = 0;
    for (const { bounds, opaque } of this.scene.objects) {
      if (opaque) continue;
      for (let i = 0; i < 8; i++) {
        const corner = [0, 1, 2].map((k) => bounds[(i >> k) & 1][k] - eye[k]);
        const ahead = fov_y == null ? 1 : dot(corner, forward);
        if (ahead > 0) reach = Math.max(reach, Math.abs(dot(corner, right)) / ahead);
      }
    }
    return Math.max(1, Math.min(1.06 * reach, whole) / ((half * size[0]) / size[1]));
  }

  dispose() {
    this.controls.dispose();
  }
}
