// Decodes a frame: a header, then half floats, pixel by pixel or square by square. It arrives in pieces.

const HEADER = 28; // bytes
const VERSION = 2;
// Views by their index in a frame's header.
const VIEWS = ["filtered", "raw", "samples", "error", "variance", "residual", "failure", "albedo", "normal", "reference", "difference", "flip"];

// Joins the pieces of frames, which arrive in order.
export class FramePieces {
  constructor() {
    this.bytes = null; // of the frame whose pieces arrive
    this.length = 0; // of its pieces so far
  }

  // Takes a piece; returns the frame's bytes if it is the last one, else null.
  add(piece) {
    this.bytes ??= new Uint8Array(frameLength(piece));
    this.bytes.set(new Uint8Array(piece), this.length);
    this.length += piece.byteLength;
    if (this.length < this.bytes.length) return null;
    const { buffer } = this.bytes;
    Object.assign(this, { bytes: null, length: 0 });
    return buffer;
  }
}

// Returns the length in bytes of the frame that begins with this piece; that of the piece if it has another format.
function frameLength(piece) {
  const head = decodeHead(piece);
  return head ? HEADER + 2 * head.columns * head.rows * head.channels : piece.byteLength;
}

// Returns the frame in a buffer; null if it has another format.
export function decodeFrame(data) {
  const head = decodeHead(data);
  return head && { ...head, halves: new Uint16Array(data, HEADER) };
}

// Returns the values of a frame's header; null if it has another format.
function decodeHead(data) {
  if (data.byteLength < HEADER) return null;
  const head = new DataView(data);
  if (head.getUint8(0) !== VERSION) return null;
  const [width, height] = [head.getUint16(4, true), head.getUint16(6, true)];
  const grid = head.getUint8(24);
  return {
    view: VIEWS[head.getUint8(1)],
    channels: head.getUint8(2),
    side: head.getUint8(3), // of the squares of pixels that one value was made for: 1 unless the image is coarse
    width, height, // of the whole image
    grid, // side of the squares of pixels that have one value each: 1 for pixels
    columns: Math.ceil(width / grid),
    rows: Math.ceil(height / grid),
    generation: head.getUint32(8, true),
    sequence: head.getUint32(12, true),
    spp: head.getFloat32(16, true),
    seconds: head.getFloat32(20, true),
  };
}
