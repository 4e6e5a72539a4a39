// Exchanges the token for a cookie.

const form = document.getElementById("form");
const [token, name] = ["token", "name"].map((id) => /** @type {HTMLInputElement} */ (document.getElementById(id)));
const answer = document.getElementById("answer");

// A QR code of the class has the code behind the #.
if (/^#\d{6}$/.test(location.hash)) {
  token.value = location.hash.slice(1);
  token.type = "text";
  name.focus();
}
name.value = localStorage.getItem("name") || "";

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  answer.textContent = "...";
  try {
    const reply = await fetch("login", {
      method: "POST",
      body: JSON.stringify({ token: token.value.trim(), name: name.value.trim() }),
    });
    if (reply.ok) {
      localStorage.setItem("name", name.value.trim());
      location.replace(".");
      return;
    }
    answer.textContent = reply.status === 429 ? "Too many attempts. Wait a moment." : "Wrong code or token.";
  } catch {
    answer.textContent = "The monitor does not answer.";
  }
});

export {}; // a module: its names are its own
