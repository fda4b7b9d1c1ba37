// Pixels of WebGL as the benchmark takes them: base64 of RGB in float32, the top row first.
export function topDown(rgba, side) {
  const rgb = new Float32Array(3 * side * side);
  for (let y = 0; y < side; y++)
    for (let x = 0; x < side; x++)
      for (let c = 0; c < 3; c++) rgb[3 * (y * side + x) + c] = rgba[4 * ((side - 1 - y) * side + x) + c];
  const bytes = new Uint8Array(rgb.buffer), parts = [];
  for (let i = 0; i < bytes.length; i += 32768) parts.push(String.fromCharCode(...bytes.subarray(i, i + 32768)));
  return btoa(parts.join(""));
}

// What draw() draws into a float target, and its seconds, of the second time: the first compiles shaders.
export function timedPicture(THREE, renderer, side, draw) {
  const target = new THREE.WebGLRenderTarget(side, side, { type: THREE.FloatType, colorSpace: THREE.LinearSRGBColorSpace });
  const pixels = new Float32Array(4 * side * side);
  const drawn = () => {
    renderer.setRenderTarget(target);
    draw();
    renderer.readRenderTargetPixels(target, 0, 0, side, side, pixels);
  };
  drawn();
  const begin = performance.now();
  drawn();
  const seconds = (performance.now() - begin) / 1000;
  renderer.setRenderTarget(null);
  target.dispose();
  return { pixels: topDown(pixels, side), seconds };
}
