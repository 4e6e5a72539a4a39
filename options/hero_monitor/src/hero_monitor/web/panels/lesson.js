// A lesson: the role of this page's user; for teachers the codes, and who is there; for an audience how to join.

import { Lines, element, make, setText } from "../dom.js";

const QUIET_CELLS = 4; // of a QR code, around it

/** "482 913": read aloud and typed in two halves. */
const spell = (code) => `${code.slice(0, 3)} ${code.slice(3)}`;

const numbersOf = (robots) => robots.map((name) => name.replace("hero_", "")).join(", ");

/** Whether this page's user may drive all of these robots. */
export function mayDrive({ user }, names) {
  return user.title === "teacher" || (user.title === "driver" && names.every((name) => user.robots.includes(name)));
}

/** What the user is, in words. */
export function roleOf({ name, title, robots }) {
  const role = title === "driver" ? `driver of ${numbersOf(robots)}` : title;
  return name ? `${role}, ${name}` : role;
}

export class LessonPanel {
  connection; painted;

  constructor({ connection }) {
    this.connection = connection;
    this.names = [];
    this.codes = new Lines(element("codes"), (code) => this.makeCode(code));
    this.users = new Lines(element("users"), () => ({ line: make("li") }));
    element("make_code").addEventListener("click", () => connection.send({ do: "code", robots: this.names }));
  }

  makeCode(code) {
    const [text, button] = [make("span"), make("button", { type: "button" }, "Withdraw")];
    button.addEventListener("click", () => this.connection.send({ do: "withdraw", code }));
    return { line: make("li", {}, text, button), text };
  }

  show({ lesson, user }, names) {
    this.names = names;
    const isTeacher = user.title === "teacher";
    element("role").hidden = isTeacher && lesson === null;
    setText(element("role"), roleOf(user));
    document.body.classList.toggle("in-class", !element("role").hidden);
    element("join").hidden = isTeacher;
    element("lesson").hidden = lesson === null;
    element("invite").hidden = lesson === null;
    if (lesson === null) return;
    for (const id of ["class_code", "invite_code"]) setText(element(id), spell(lesson.code));
    for (const id of ["class_link", "invite_link"]) setText(element(id), lesson.link);
    element("make_code").disabled = names.length === 0;
    setText(element("make_code"), names.length ? `Code to drive ${numbersOf(names)}` : "Choose robots to make a code");
    const fillCode = ({ text }, [code, robots]) => setText(text, `${spell(code)} drives ${numbersOf(robots)}`);
    this.codes.show(lesson.drivers, ([code]) => code, fillCode);
    const users = lesson.users.map(([name, title, robots], index) => [index, roleOf({ name, title, robots })]);
    this.users.show(users, ([index]) => index, ({ line }, [, text]) => setText(line, text));
    this.paintCode(lesson.qr);
  }

  paintCode(rows) {
    const canvas = element("qr");
    canvas.hidden = rows.length === 0;
    if (String(rows) === this.painted) return;
    this.painted = String(rows);
    canvas.width = canvas.height = rows.length + 2 * QUIET_CELLS;
    const context = canvas.getContext("2d");
    context.fillStyle = "#fff";
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.fillStyle = "#000";
    rows.forEach((row, y) => [...row].forEach((cell, x) => cell === "1" && context.fillRect(x + QUIET_CELLS, y + QUIET_CELLS, 1, 1)));
  }
}
