// The page of a structure: the sketch selects a place, and what is known of it is drawn from tables that Python has
// filled for all places. What is clicked goes to Python as on the page of one coordinate, whose script runs before.
;(() => {
  const {model, column, put, place, asked, DRAWN, LITTLE, NOBODY} = window.study
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
    for (const to of ["motion", "close", "spectrum"]) draw(`all_${to}`, to, name)
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

  function follow(name) {
    row = name
    const element = [...all("[data-row]")].find((item) => item.dataset.row === name)
    const keep = []
    column("all_constancy", "of").forEach((value, i) => { if (value === name) keep.push(i) })
    const of = (key) => keep.map((i) => column("all_constancy", key)[i]), none = [NaN, NaN]
    put("shown", keep.length ? {f: of("f"), value: of("value"), low: of("low"), high: of("high"), zero: keep.map(() => 0)}
      : {f: [0, 1], value: none, low: none, high: none, zero: [0, 0]})
    if (element) model("constancy_y").axis_label = element.dataset.label
    place("constancy-of").textContent = element ? `${element.querySelector(".name").textContent}, 95 % intervals` : ""
    place("constancy-card").classList.toggle("none", !keep.length)
    place("constancy-none").hidden = keep.length > 0 || !asked()
    place("constancy-none").textContent = element ? LITTLE : NOBODY
    place("detail").innerHTML = element?.querySelector("small").innerHTML ?? ""
    for (const item of all("[data-row]")) item.classList.toggle("shown", item === element)
  }

  // ---- the words of the present model; a place that was clicked stays selected
  function words() {
    const places = column("words", "place"), html = column("words", "html")
    places.forEach((id, i) => { const element = place(id); if (element) element.innerHTML = html[i] })
    const panels = column("units", "panel"), labels = column("units", "label")
    panels.forEach((name, i) => { model(name).axis_label = labels[i] })
    const known = [...all("#sketch [data-place]")], first = document.querySelector("[data-row]")
    const glowing = known.find((item) => item.classList.contains("selected"))
    if (!moved || !known.some((item) => item.dataset.place === where)) where = glowing?.dataset.place ?? known[0].dataset.place
    select(where)
    follow(first ? first.dataset.row : null)
  }

  const under = (event, key) => event.composedPath().find((e) => e.dataset && e.dataset[key] !== undefined)
  function chosen(event) {
    if (under(event, "act")) return
    const link = event.target.closest?.("#sketch [data-place]"), candidate = under(event, "row")
    if (link) { moved = true; select(link.dataset.place) }
    if (candidate) { moved = true; follow(candidate.dataset.row); select(candidate.dataset.at) }
  }
  document.addEventListener("click", chosen)
  document.addEventListener("keydown", (event) => {
    const meant = event.target.closest?.("#sketch [data-place], [data-row]")
    if ((event.key === "Enter" || event.key === " ") && meant === event.target) { event.preventDefault(); chosen(event) }
  })
  for (const kind of ["mouseover", "focusin"])
    document.addEventListener(kind, (event) => {
      const candidate = under(event, "row")
      if (candidate && candidate.dataset.row !== row && window.study.ready) follow(candidate.dataset.row)
    })

  Object.assign(window.study, {words, select, look})
})()
