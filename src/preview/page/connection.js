// The WebSocket to the render: frames, status and answers in, messages out. Reconnects when it breaks.

export const HEADER = 24; // bytes
const VERSION = 1;
// Views by their index in a frame's header.
const VIEWS = ["filtered", "raw", "samples", "error", "variance", "residual", "failure", "albedo", "normal"];
const RETRY_MILLISECONDS = 1000;

export class Connection {
  // `on`: callbacks { open, lost, frame, status, values, refused }.
  constructor(on) {
    this.on = on;
    this.connect();
    // A hidden page asks for no frames, so that none are encoded for it.
    document.addEventListener("visibilitychange", () => this.isReadyPending && this.ready());
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/live${location.search}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.on.open(); this.ready(); };
    this.socket.onmessage = ({ data }) => typeof data === "string" ? this.receiveMessage(JSON.parse(data)) : this.receiveFrame(data);
    this.socket.onclose = () => { this.on.lost(); setTimeout(() => this.connect(), RETRY_MILLISECONDS); };
  }

  send(type, content = {}) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ type, ...content }));
  }

  // Asks for the next frame, now or when the page becomes visible.
  ready() {
    this.isReadyPending = document.hidden;
    if (!this.isReadyPending) this.send("ready");
  }

  receiveMessage(message) {
    this.on[message.type]?.(message);
  }

  receiveFrame(data) {
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
