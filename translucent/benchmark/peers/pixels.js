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
