// Colors by robot and theme: one hue per robot, light or dark as the browser is set; style.css has those of the page.

const query = matchMedia("(prefers-color-scheme: dark)");

export const isDark = () => query.matches;

/** Call redraw() when the browser changes between light and dark. */
export const onTheme = (redraw) => query.addEventListener("change", redraw);

/** A robot's color: hues lie a golden angle apart, so that robots with neighboring ids differ most. */
export function colorOf(id, alpha = 1) {
  const hue = (((id * 137.508 + 24) % 360) + 360) % 360;
  return `hsl(${hue.toFixed(0)} 70% ${isDark() ? 62 : 42}% / ${alpha})`;
}
