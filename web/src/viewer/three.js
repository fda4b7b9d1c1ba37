// The parts of three.js that the viewer takes, without its renderer.

export { Controls } from "three/src/extras/Controls.js";
export { MOUSE, TOUCH } from "three/src/constants.js";
export { Quaternion } from "three/src/math/Quaternion.js";
export { Spherical } from "three/src/math/Spherical.js";
export { Vector2 } from "three/src/math/Vector2.js";
export { Vector3 } from "three/src/math/Vector3.js";
export { Plane } from "three/src/math/Plane.js";
export { Ray } from "three/src/math/Ray.js";
export * as MathUtils from "three/src/math/MathUtils.js";
export { OrthographicCamera } from "three/src/cameras/OrthographicCamera.js";
export { PerspectiveCamera } from "three/src/cameras/PerspectiveCamera.js";
