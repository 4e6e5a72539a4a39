// Exchanges the token for a cookie.

import "./theme.js";

const form = document.getElementById("form");
const answer = document.getElementById("answer");

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  answer.textContent = "...";
  try {
    const reply = await fetch("login", {
      method: "POST",
      body: JSON.stringify({ token: /** @type {HTMLInputElement} */ (document.getElementById("token")).value.trim() }),
    });
    if (reply.ok) {
      location.reload();
      return;
    }
    answer.textContent = reply.status === 429 ? "Too many attempts. Wait a moment." : "Wrong token.";
  } catch {
    answer.textContent = "The monitor does not answer.";
  }
});
