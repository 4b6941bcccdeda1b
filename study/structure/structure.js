document.documentElement.classList.add("scripted");
const select = (place) => {
  for (const item of document.querySelectorAll("[data-place]")) {
    item.classList.toggle("selected", item.dataset.place === place);
  }
};
for (const link of document.querySelectorAll(".link")) {
  link.addEventListener("click", () => select(link.dataset.place));
  link.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      select(link.dataset.place);
    }
  });
}
