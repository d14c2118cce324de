// Decodes a frame: a header, then half floats, pixel by pixel.

const HEADER = 24; // bytes
const VERSION = 1;
// Views by their index in a frame's header.
const VIEWS = ["filtered", "raw", "samples", "error", "variance", "residual", "failure", "albedo", "normal", "reference", "difference", "flip"];

// Returns the frame in a buffer; null if it has another format.
export function decodeFrame(data) {
  if (data.byteLength < HEADER) return null;
  const head = new DataView(data);
  if (head.getUint8(0) !== VERSION) return null;
  return {
    view: VIEWS[head.getUint8(1)],
    channels: head.getUint8(2),
    side: head.getUint8(3), // of the squares of pixels that one value was made for: 1 unless the image is coarse
    width: head.getUint16(4, true),
    height: head.getUint16(6, true),
    generation: head.getUint32(8, true),
    sequence: head.getUint32(12, true),
    spp: head.getFloat32(16, true),
    seconds: head.getFloat32(20, true),
    halves: new Uint16Array(data, HEADER),
  };
}
