/** With a minus that is one, as in "−1.2 cm". */
export function inCm(distance_m: number): string {
  return `${(100 * distance_m).toFixed(1).replace("-", "\u2212")} cm`;
}
