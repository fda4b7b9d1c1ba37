// For pages of tests: arrays from and to base64, scenes of meshes, cameras as Python has them. Needs the browser bundle.
globalThis.tools = (() => {
  const { THREE } = translucentThree;

  function bytes(text) {
    return Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  }

  function base64(array) {
    const all = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    let text = "";
    for (let i = 0; i < all.length; i += 32768) text += String.fromCharCode(...all.subarray(i, i + 32768));
    return btoa(text);
  }

  function geometry({ positions, index }) {
    const made = new THREE.BufferGeometry();
    made.setAttribute("position", new THREE.BufferAttribute(new Float32Array(bytes(positions)), 3));
    if (index) made.setIndex(new THREE.BufferAttribute(new Uint32Array(bytes(index)), 1));
    return made;
  }

  // matrix: rows of 4 x 4 numbers.
  function mesh(described, material = new THREE.MeshBasicMaterial()) {
    const made = new THREE.Mesh(geometry(described), material);
    if (described.matrix) {
      made.matrix.set(...described.matrix.flat());
      made.matrixAutoUpdate = false;
    }
    return made;
  }

  // pose: camera to world, rows of 4 x 4 numbers; fov_y in degrees, or null with height for an orthographic one.
  function camera({ pose, fov_y, height, aspect, near = 0.01, far = 1000 }) {
    const up = height / 2;
    const made = fov_y
      ? new THREE.PerspectiveCamera(fov_y, aspect, near, far)
      : new THREE.OrthographicCamera(-up * aspect, up * aspect, up, -up, near, far);
    made.matrix.set(...pose.flat());
    made.matrix.decompose(made.position, made.quaternion, made.scale);
    return made;
  }

  function renderer(width, height, options = {}) {
    const made = new THREE.WebGLRenderer({ antialias: false, ...options });
    made.setPixelRatio(1);
    made.setSize(width, height);
    document.body.appendChild(made.domElement);
    return made;
  }

  // What the pass reads back, as base64.
  function pixels(pass) {
    return encoded(pass.read());
  }

  function encoded({ width, height, thickness, count, valid, covered }) {
    return { width, height, thickness: base64(thickness), count: base64(count), valid: base64(valid), covered: base64(covered) };
  }

  // A renderer, gone with all that it holds once `use` is done.
  function withRenderer([width, height], use, options) {
    const made = renderer(width, height, options);
    try {
      return use(made);
    } finally {
      made.dispose();
      made.forceContextLoss();
      made.domElement.remove();
    }
  }

  // What the pass finds of a scene.
  function measured(pass, scene, seen) {
    pass.render(scene, camera(seen));
    return { ...pixels(pass), precision: pass.precision };
  }

  return { withRenderer, measured, bytes, base64, geometry, mesh, camera, renderer, pixels, encoded };
})();
