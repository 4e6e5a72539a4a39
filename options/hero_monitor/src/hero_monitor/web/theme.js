// Light or dark, as the browser is set; style.css has the colors of the page itself.

const query = matchMedia("(prefers-color-scheme: dark)");

export const isDark = () => query.matches;

/** Call redraw() when the browser changes between the two. */
export const onTheme = (redraw) => query.addEventListener("change", redraw);
