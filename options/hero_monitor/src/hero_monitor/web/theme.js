// Light or dark: as chosen on this page, else as the browser is.

const query = matchMedia("(prefers-color-scheme: dark)");

export const isDark = () => document.documentElement.dataset.theme === "dark";

export function showTheme() {
  document.documentElement.dataset.theme = localStorage.getItem("theme") || (query.matches ? "dark" : "light");
}

/** Call redraw() when the browser changes between the two. */
export function onTheme(redraw) {
  query.addEventListener("change", () => {
    showTheme();
    redraw();
  });
}

showTheme();
