// The page of a structure: the sketch selects a place, and what is known of it is drawn from tables that Python has
// filled for all places. What is clicked goes to Python as on the page of one coordinate, whose script runs before.
;(() => {
  const {stage, follow, under, model, column, put, place, DRAWN} = window.study
  const all = (selector) => document.querySelectorAll(selector)
  let where = null, sensor = null, moved = false, row = null

  Object.assign(DRAWN, {
    sensors: ["sensors"], map: ["map"], force: ["force"], stiffness: ["stiffness"], motion: ["motion"],
    difference: ["motion"], close: ["close"], spectrum: ["spectrum"],
  })

  // the rows of a table that bear a mark, into the source that is drawn
  function draw(from, to, mark) {
    const data = model(from).data, keep = []
    column(from, "of").forEach((value, i) => { if (value === mark) keep.push(i) })
    const shown = {}
    for (const key of Object.keys(data)) if (key !== "of") shown[key] = keep.length ? keep.map((i) => data[key][i]) : [0, 1]  // an axis needs some; nobody sees it
    put(to, shown)
    const panel = document.querySelector(`[data-none=${to}]`)?.parentElement
    if (panel) panel.classList.toggle("empty", keep.length === 0)
  }

  function select(label) {
    where = label
    for (const item of all("#sketch [data-place], #places [data-place]"))
      item.classList.toggle("selected", item.dataset.place === label)
    for (const name of ["map", "force", "stiffness"]) draw(`all_${name}`, name, label)
    const ends = document.querySelector("#places .selected")?.dataset.ends.split(" ") ?? []
    const names = column("sensors", "name"), at = column("sensors", "at"), error = column("sensors", "error")
    const near = names.map((_, i) => i).filter((i) => ends.includes(at[i])).sort((a, b) => error[b] - error[a])
    look(near.length ? names[near[0]] : sensor ?? names[0])
  }

  function look(name) {
    sensor = name
    for (const to of ["motion", "close", "spectrum", "autocorrelation", "histogram"]) draw(`all_${to}`, to, name)
    const label = column("sensors", "unit")[column("sensors", "name").indexOf(name)]
    for (const axis of ["motion_y", "close_y"]) model(axis).axis_label = label
    model("difference_y").axis_label = label.replace(/^\S+/, "difference")
    const chosen = place("sensor-buttons")
    chosen.replaceChildren(...column("sensors", "name").map((text) => {
      const button = Object.assign(document.createElement("button"), {textContent: text})
      button.setAttribute("aria-pressed", String(text === name))
      button.addEventListener("click", () => look(text))
      return button
    }))
  }

  function candidate(name) {
    row = name
    const element = [...all("[data-row]")].find((item) => item.dataset.row === name), keep = []
    column("all_constancy", "of").forEach((value, i) => { if (value === name) keep.push(i) })
    follow(element, "all_constancy", keep, element?.querySelector(".name").textContent)
  }

  // ---- the words of the present model; a place that was clicked stays selected
  function words() {
    stage()
    const known = [...all("#sketch [data-place]")], first = document.querySelector("[data-row]")
    const glowing = known.find((item) => item.classList.contains("selected"))
    if (!moved || !known.some((item) => item.dataset.place === where)) where = glowing?.dataset.place ?? known[0].dataset.place
    select(where)
    candidate(first ? first.dataset.row : null)
  }

  function clicked(event) {
    if (!window.study.ready || under(event, "act")) return
    const link = event.target.closest?.("#sketch [data-place]"), chosen = under(event, "row")
    if (link) { moved = true; select(link.dataset.place) }
    if (chosen) { moved = true; candidate(chosen.dataset.row); select(chosen.dataset.at) }
  }
  document.addEventListener("click", clicked)
  document.addEventListener("keydown", (event) => {
    const meant = event.target.closest?.("#sketch [data-place], [data-row]")
    if ((event.key === "Enter" || event.key === " ") && meant === event.target) { event.preventDefault(); clicked(event) }
  })
  for (const kind of ["mouseover", "focusin"])
    document.addEventListener(kind, (event) => {
      const pointed = under(event, "row")
      if (pointed && pointed.dataset.row !== row && window.study.ready) candidate(pointed.dataset.row)
    })

  Object.assign(window.study, {words, select, look})
})()
