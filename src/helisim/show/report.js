// Marks the section that is read in the list of sections; closes a phone's menu after a choice.
const links = [...document.querySelectorAll("nav a")];
const sections = links.map((link) => document.querySelector(link.hash));
const menu = document.getElementById("sections");
const button = document.querySelector("nav button");
let current;
function mark() {
  const end = scrollY > 0 && scrollY + innerHeight >= document.documentElement.scrollHeight - 2;
  const passed = sections.filter((section) => section.getBoundingClientRect().top < 0.3 * innerHeight);
  const next = links[end ? links.length - 1 : Math.max(passed.length - 1, 0)];
  if (next === current) return;
  current?.removeAttribute("aria-current");
  next?.setAttribute("aria-current", "true");
  button.textContent = `\u2630 ${next?.textContent ?? "Sections"}`;
  current = next;
}
addEventListener("scroll", mark, { passive: true });
addEventListener("resize", mark);
menu.addEventListener("click", (event) => event.target.closest("a") && menu.hidePopover());
mark();
