// Container of a page's data: see translucent/page/container.py.

const MAGIC = "TLPAGE01";
const TYPES = { float32: Float32Array, float16: Uint16Array, uint32: Uint32Array, uint8: Uint8Array };

/** Bytes of base64 text. */
function bytesOf(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function unzipped(bytes) {
  if (bytes[0] !== 0x1f || bytes[1] !== 0x8b) return bytes;
  if (typeof DecompressionStream === "undefined") {
    throw new Error("this browser cannot unpack the page (no DecompressionStream): use one from 2023 or later");
  }
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Words from planes of bytes of differences. */
function words(bytes, section) {
  const shape = section.shape;
  const count = shape.reduce((a, b) => a * b, 1);
  const found = new Uint32Array(count);
  for (let i = 0; i < count; i++) {
    const folded = bytes[i] | (bytes[count + i] << 8) | (bytes[2 * count + i] << 16) | (bytes[3 * count + i] << 24);
    found[i] = (folded >>> 1) ^ -(folded & 1);
  }
  const channels = shape[shape.length - 1];
  const width = shape[shape.length - 2] * channels;
  for (let row = 0; row < count; row += width) {
    for (let i = row + channels; i < row + width; i++) found[i] += found[i - channels];
  }
  if (section.packing === "picture") {
    const rows = shape[shape.length - 3];
    for (let picture = 0; picture < count; picture += rows * width) {
      for (let i = picture + width; i < picture + rows * width; i++) found[i] += found[i - width];
    }
  }
  if (section.shift) for (let i = 0; i < count; i++) found[i] <<= section.shift;
  return found;
}

/**
 * Header of a container, with `sections` as typed arrays with a `shape`.
 * @param {string | ArrayBuffer | Uint8Array} payload base64 text, or bytes
 */
export async function opened(payload) {
  const given = typeof payload === "string" ? bytesOf(payload) : new Uint8Array(payload.buffer ?? payload, payload.byteOffset ?? 0, payload.byteLength);
  const bytes = await unzipped(given);
  const magic = String.fromCharCode(...bytes.subarray(0, 8));
  if (magic !== MAGIC) throw new Error("this is no data of a translucent page, or one of another version");
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(16, 16 + length)));
  const start = 16 + length;
  header.sections = header.sections.map((section) => {
    const part = bytes.subarray(start + section.offset, start + section.offset + section.bytes);
    const Type = TYPES[section.type];
    let array;
    if (section.packing === "plain") {
      const copy = part.slice();
      array = new Type(copy.buffer, 0, copy.byteLength / Type.BYTES_PER_ELEMENT);
    } else {
      array = new Type(words(part, section).buffer);
    }
    array.shape = section.shape;
    return array;
  });
  return header;
}
