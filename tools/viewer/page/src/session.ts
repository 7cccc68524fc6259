// What has been told on this connection and those before it: one history an episode.
import { History } from "./history";
import type { World } from "./messages";
import { decode } from "./protocol";

export class Session {
  /** Of a live run the current one alone. */
  readonly episodes: History[] = [];
  private current: History | null = null;
  /** The last one told of, which need not be the one that is looked at. */
  private told: History | null = null;

  /** `began`: a history is to be looked at from now on. */
  constructor(private readonly began: (history: History) => void) {}

  get history(): History | null {
    return this.current;
  }

  /** Throws ProtocolError for what keeps not to the protocol; all else stays as it was. */
  take(data: ArrayBuffer): void {
    const message = decode(data, this.told?.world ?? null);
    if (message.kind === "world") this.begin(message);
    // The same run, begun anew while nobody listened.
    else if (this.told?.isFromBefore(message)) this.beginAnew(this.told.world);
    this.told?.add(message);
  }

  choose(index: number): void {
    const history = this.episodes[index];
    if (history === undefined || history === this.current) return;
    this.current = history;
    this.began(history);
  }

  private begin(world: World): void {
    const known = this.told?.continues(world) ? this.told : null;
    // A recording comes whole again after a lost connection.
    const again = this.episodes.find((one) => world.recorded && one.world.identity === world.identity);
    if (known !== null || again !== undefined) {
      this.told = known ?? (again as History);
      return;
    }
    this.beginAnew(world);
  }

  private beginAnew(world: World): void {
    const history = new History(world);
    if (!world.recorded) this.episodes.length = 0;
    this.episodes.push(history);
    this.told = history;
    if (world.recorded && this.episodes.length > 1) return;
    this.current = history;
    this.began(history);
  }
}
