// The WebSocket to a run: it is opened again and again until someone answers.

export type ConnectionState = "connecting" | "open" | "lost";

export interface ConnectionHandlers {
  message(data: ArrayBuffer): void;
  /** `retry_s`: in how many seconds the next attempt is due; 0 but when lost. */
  changed(state: ConnectionState, retry_s: number): void;
}

const kFirstRetry_s = 0.25;
const kLastRetry_s = 8;

/** The page's own host, and the token that the page was opened with. */
export function socketUrl(page: Location): string {
  const url = new URL("/socket", page.href);
  url.protocol = page.protocol === "https:" ? "wss:" : "ws:";
  const token = new URLSearchParams(page.search).get("token");
  if (token !== null) url.searchParams.set("token", token);
  return url.href;
}

export class Connection {
  private socket: WebSocket | null = null;
  private retry_s = kFirstRetry_s;
  private timer = 0;

  constructor(
    private readonly url: string,
    private readonly handlers: ConnectionHandlers,
  ) {}

  open(): void {
    window.clearTimeout(this.timer);
    if (this.socket !== null) return;
    this.handlers.changed("connecting", 0);
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => this.handlers.changed("open", 0);
    socket.onmessage = (event) => {
      // Whoever takes us in but tells nothing is asked less and less often.
      this.retry_s = kFirstRetry_s;
      if (event.data instanceof ArrayBuffer) this.handlers.message(event.data);
    };
    socket.onclose = () => this.lost();
  }

  /** Lost, where nobody listens: what matters is asked for again at the next opening. */
  send(request: object): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }

  private lost(): void {
    this.socket = null;
    const wait_s = this.retry_s;
    this.retry_s = Math.min(2 * this.retry_s, kLastRetry_s);
    this.handlers.changed("lost", wait_s);
    this.timer = window.setTimeout(() => this.open(), 1000 * wait_s);
  }
}
