// One hue per robot, a golden angle apart: robots with neighbouring ids differ most.

import { isDark } from "../theme.js";

export function colorOf(id, alpha = 1) {
  const hue = (((id * 137.508 + 24) % 360) + 360) % 360;
  return `hsl(${hue.toFixed(0)} 70% ${isDark() ? 62 : 42}% / ${alpha})`;
}
