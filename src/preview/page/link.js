// The socket: frames and reports come in, commands go out. Takes up the thread again when it breaks.

export const HEADER = 24;
const VERSION = 1;
// Views by their code in a frame's header.
const VIEWS = ["filtered", "raw", "samples", "error", "variance", "residual", "failure", "albedo", "normal"];
const RETRY_MILLISECONDS = 1000;

export class Link {
  // `on`: { open, frame, status, values, refused, lost }.
  constructor(on) {
    this.on = on;
    this.connect();
    // A hidden page takes no images, so that none are made for it.
    document.addEventListener("visibilitychange", () => this.owes && this.ready());
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/live${location.search}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.on.open(); this.ready(); };
    this.socket.onmessage = ({ data }) => typeof data === "string" ? this.hear(JSON.parse(data)) : this.see(data);
    this.socket.onclose = () => { this.on.lost(); setTimeout(() => this.connect(), RETRY_MILLISECONDS); };
  }

  send(type, content = {}) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ type, ...content }));
  }

  // Asks for the next image, now or when the page is seen again.
  ready() {
    this.owes = document.hidden;
    if (!this.owes) this.send("ready");
  }

  hear(message) {
    this.on[message.type]?.(message);
  }

  see(data) {
    const head = new DataView(data);
    if (head.byteLength < HEADER || head.getUint8(0) !== VERSION) return this.ready();
    this.on.frame({
      view: VIEWS[head.getUint8(1)],
      channels: head.getUint8(2),
      width: head.getUint16(4, true),
      height: head.getUint16(6, true),
      generation: head.getUint32(8, true),
      sequence: head.getUint32(12, true),
      spp: head.getFloat32(16, true),
      seconds: head.getFloat32(20, true),
      halves: new Uint16Array(data, HEADER),
    });
  }
}

// The number that a half float stands for.
export function fromHalf(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}
