// The rules for the page's JavaScript. script/lint copies this file beside the packages that it imports.
import js from "@eslint/js";
import globals from "globals";

const rules = { eqeqeq: "error", "no-var": "error", "prefer-const": ["error", { destructuring: "all" }], "no-shadow": "error" };

export default [
  { ignores: ["**/vendor/**"] },
  js.configs.recommended,
  { languageOptions: { globals: { ...globals.browser, uPlot: "readonly" } }, rules },
];
