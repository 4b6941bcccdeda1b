// Pictures open large, a click on a heading sorts its table, a word searches the claims of a page that has them.
const large = document.getElementById("large")
document.querySelectorAll(".thumb").forEach((thumb) => thumb.addEventListener("click", () => {
  const picture = thumb.querySelector("img")
  large.querySelector("img").src = picture.src
  large.querySelector("img").alt = picture.alt
  large.querySelector("figcaption").textContent = picture.alt
  large.showModal()
}))
large.addEventListener("click", (event) => { if (event.target === large || event.target.tagName === "BUTTON") large.close() })

const numeric = (text) => { const n = parseFloat(text.replace(/[^0-9.eE+-]/g, "")); return Number.isNaN(n) ? null : n }
const value = (row, column) => row.cells[column].textContent.trim()
document.querySelectorAll("table").forEach((table) => table.querySelectorAll("th").forEach((head, column) => {
  const button = document.createElement("button")
  button.textContent = head.textContent
  head.replaceChildren(button)
  button.addEventListener("click", () => {
    const up = head.getAttribute("aria-sort") !== "ascending"
    const body = table.tBodies[0], rows = [...body.rows]
    const numbers = rows.every((row) => value(row, column) === "" || /^[+-]?[0-9]/.test(value(row, column)))
    rows.sort((a, b) => {
      const [x, y] = [a, b].map((row) => numbers ? (numeric(value(row, column)) ?? Infinity) : value(row, column))
      return (x < y ? -1 : x > y ? 1 : 0) * (up ? 1 : -1)
    })
    body.replaceChildren(...rows)
    table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"))
    head.setAttribute("aria-sort", up ? "ascending" : "descending")
  })
}))

const search = document.getElementById("search")
search?.addEventListener("input", () => {
  const word = search.value.toLowerCase()
  document.querySelectorAll("#claims details").forEach((claim) => { claim.hidden = !claim.textContent.toLowerCase().includes(word) })
})
const open = () => { const claim = document.getElementById(location.hash.slice(1)); if (claim?.tagName === "DETAILS") claim.open = true }
addEventListener("hashchange", open)
open()
