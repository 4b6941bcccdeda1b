// What the page does by itself: step through the history, turn to another sensor or place, preview a candidate, join
// selections, export, pass on what is clicked. It draws from tables that Python has filled, so that a saved page does the
// same without a server.
window.study = (() => {
  const model = (name) => Bokeh.documents[0].get_model_by_name(name)
  const column = (name, key) => model(name).get_column(key)
  const put = (name, data) => { model(name).data = data }
  const place = (id) => document.getElementById(id)
  const all = (selector) => document.querySelectorAll(selector)

  // ---- words and axes of the present stage
  const framed = {}
  function set(frame) {
    const [names, properties, values] = ["model", "property", "value"].map((key) => column(frame, key))
    for (let i = 0; i < names.length; i++) {
      if (properties[i] === "html") { say(names[i], values[i]); continue }
      const target = model(names[i]), key = names[i] + properties[i]
      // a zoom in time stays from model to model, and goes where another record has other times
      const before = names[i] === "range_time" ? framed[key] : target?.[properties[i]]
      framed[key] = values[i]
      if (target && before !== values[i]) target[properties[i]] = values[i]
    }
  }

  function say(id, html) { const element = place(id); if (element) element.innerHTML = html }

  // another model, or another record: what was selected or pinned belongs to the one before
  function words() {
    const said = column("words", "html")
    column("words", "place").forEach((id, i) => say(id, said[i]))
    set("frame")
    pins = []
    hovered = null
    look()
    settled()
  }

  // what the panels show has changed
  function settled() {
    for (const frame of ["frame_sensor", "frame_place"]) set(frame)
    mark()
    far = null
    clear()
    preview(hovered)
    catch_up()
  }

  function mark() {
    for (const button of all("[data-act=sensor]"))
      button.setAttribute("aria-pressed", String(button.dataset.name === seen.sensor))
    for (const item of all("#sketch [data-place], #places [data-place]"))
      item.classList.toggle("selected", item.dataset.place === seen.place)
  }

  // ---- which sensor and which place are looked at: those that were chosen, or where the sketch glows most
  const seen = {}
  let chosen = false
  function look() {
    for (const what of ["sensor", "place"]) seen[what] ??= column("turned", what)[0]
    const links = [...all("#sketch [data-place]")], glowing = links.find((item) => item.classList.contains("selected"))
    if (glowing && !(chosen && links.some((item) => item.dataset.place === seen.place))) near(glowing.dataset.place)
    turn()
  }
  function near(name) {
    seen.place = name
    seen.sensor = [...all("#places [data-place]")].find((item) => item.dataset.place === name).dataset.sensor
  }
  function choose(change) {
    chosen = true
    change()
    mark()
    turn()
    if (!model("asked")) settled()
  }
  const select = (name) => choose(() => near(name))

  // a live page asks for what it has not got, a saved one has it
  function turn() {
    for (const what of ["sensor", "place"])
      if (!model("asked")) pull(`${base()}.${what}.${seen[what]}`)
      else if (column("turned", what)[0] !== seen[what]) ask(what, seen[what])
    if (!model("asked")) put("turned", {sensor: [seen.sensor], place: [seen.place]})
  }
  const base = () => `${present ?? last()}.${pressed()}`
  function pull(of) {
    for (const source of Bokeh.documents[0].all_models) {
      const at = source.name?.indexOf("@") ?? -1
      if (at > 0 && source.name.slice(at + 1) === of) model(source.name.slice(0, at)).data = source.data
    }
  }

  // ---- what one candidate would leave, or two: one that is pinned beside the one that is pointed at, or two pinned
  let previewed = false, pins = []
  function preview(i) {
    const [first, second] = pins
    const shown = second ?? i ?? first ?? null, beside = first !== undefined && first !== shown ? first : null
    drawn("ghost", "candidate", shown)
    drawn("pinned", "pinned", beside)
    const has = known(shown)
    if (has || previewed) {
      const mean = has ? column("would_plane", String(shown)) : column("plane", "found")
      put("plane", {...model("plane").data, mean, below: Float32Array.from(mean, (m) => (m < -1e-6 * model("mapper").high ? 5 : 0))})
    }
    previewed = has
    constancy(has ? shown : 0, beside)
  }

  const known = (i) => i !== null && model("would_time").get_column(String(i)) !== null
  function drawn(kind, label, i) {
    const has = known(i)
    const line = (name, x, y) => {
      if (has) put(`${kind}_${name}`, {[x]: column(name, x), y: column(y, String(i))})
      else empty(`${kind}_${name}`, {[x]: [], y: []})
    }
    line("time", "t", "would_time")
    line("spectrum", "f", "would_spectrum")
    for (const of of ["u", "v"]) {
      const [at, y] = has ? [column(`would_${of}`, `at${i}`), column(`would_${of}`, `y${i}`)] : [[], []]
      put(`${kind}_${of}`, {at, y})
    }
    for (const name of ["difference", "spectrum", "against_u", "against_v"]) entry(name, label, has)
  }

  // a click on a candidate pins it, another one lets it go; of three the first goes
  function pin(i) {
    pins = pins.includes(i) ? pins.filter((other) => other !== i) : [...pins, i].slice(-2)
    for (const row of all("[data-candidate]")) {
      row.classList.toggle("pinned", pins.includes(Number(row.dataset.candidate)))
      row.classList.toggle("second", pins[1] === Number(row.dataset.candidate))
    }
    preview(hovered)
  }

  const entry = (name, label, on) => { const item = model(`panel_${name}_${label}`); if (item) item.visible = on }

  // ---- the coefficient of a candidate along frequency
  const LITTLE = "It explains too little for its coefficient to be followed along frequency."
  const NOBODY = "No candidate explains any of what is left: there is no coefficient to follow along frequency."
  const row = (i) => document.querySelector(`[data-candidate="${i}"]`)
  const said = (i) => row(i)?.querySelector("small").innerHTML ?? ""

  function constancy(i, beside) {
    const element = row(i), keep = []
    if (element) column("constancy", "row").forEach((value, k) => { if (value === i) keep.push(k) })
    const none = [NaN, NaN], shown = {f: [0, 1], value: none, low: none, high: none}  // an axis needs two points
    if (keep.length) for (const key in shown) shown[key] = keep.map((k) => column("constancy", key)[k])
    put("shown", {...shown, zero: shown.f.map(() => 0)})
    if (element) model("constancy_y").axis_label = element.dataset.label
    const empty = place("constancy-none")
    say("constancy-of", element ? `${element.dataset.of}, 95 % intervals` : "")
    place("constancy-card")?.classList.toggle("none", !keep.length)
    if (empty) empty.hidden = keep.length > 0 || document.querySelector("#verdict h3") === null
    if (empty) empty.textContent = element ? LITTLE : NOBODY
    say("detail", beside === null ? said(i) : `<div class="two"><p>${said(beside)}</p><p>${said(i)}</p></div>`)
    for (const other of all("[data-candidate]")) other.classList.toggle("shown", other === element)
  }

  // ---- selections: whatever is selected weighs the blocks of time, and these weigh everything else
  const KINDS = {
    time: ["box_response", "box_difference"], band: ["box_force", "box_coherence", "box_spectrum"],
    u: ["box_against_u"], v: ["box_against_v"],
  }

  const boxes = (kind) => KINDS[kind].map(model).filter(Boolean)

  // what a table has of a block of time
  function block(name, key, b) {
    const table = column(name, key), many = column("blocks", "left").length, mine = new Float64Array(table.length / many)
    for (let i = 0; i < mine.length; i++) mine[i] = table[i * many + b]
    return mine
  }

  function weights(kind, from, to) {
    const left = column("blocks", "left"), right = column("blocks", "right"), w = new Float64Array(left.length)
    const inside = (a, b) => Math.max(0, Math.min(b, to) - Math.max(a, from)) / (b - a)
    for (let b = 0; b < w.length; b++) {
      if (kind === "time") { w[b] = inside(left[b], right[b]); continue }
      if (kind === "band") {
        const f = column("lines", "f"), p = block("lines", "p", b)
        for (let i = 0; i < f.length; i++) if (f[i] >= from && f[i] <= to) w[b] += p[i]
        continue
      }
      const low = column(`classes_${kind}`, "left"), high = column(`classes_${kind}`, "right")
      const n = block(`classes_${kind}`, "n", b)
      let all = 0
      for (let i = 0; i < n.length; i++) { w[b] += n[i] * inside(low[i], high[i]); all += n[i] }
      w[b] = all > 0 ? w[b] / all : 0
    }
    const most = Math.max(...w)
    return most > 0 ? w.map((x) => x / most) : w
  }

  function sums(name, key, w) {
    const total = new Float64Array(column(name, key).length / w.length)
    for (let b = 0; b < w.length; b++) {
      const mine = block(name, key, b)
      for (let i = 0; i < total.length; i++) total[i] += w[b] * mine[i]
    }
    return total
  }

  function curve(kind, w) {
    const low = column(`classes_${kind}`, "left"), high = column(`classes_${kind}`, "right")
    const n = sums(`classes_${kind}`, "n", w), s = sums(`classes_${kind}`, "s", w), data = {at: [], y: []}
    for (let i = 0; i < n.length; i++)
      if (n[i] >= 8) { data.at.push(0.5 * (low[i] + high[i])); data.y.push(s[i] / n[i]) }
    return data
  }

  function cells(kind, from, to, w) {
    const seen = column("plane", "seen"), middle = kind === "u" || kind === "v" ? column("plane", `middle_${kind}`) : null
    const mine = sums("cells", "n", w), all = sums("cells", "n", w.map(() => 1))
    const usual = w.reduce((a, b) => a + b, 0) / w.length
    return Float32Array.from(seen, (s, i) => {
      if (!s) return 0
      if (middle) return middle[i] >= from && middle[i] <= to ? 1 : 0
      return kind === "time" ? (mine[i] >= 1 ? 1 : 0) : (mine[i] > 1.1 * usual * all[i] ? 1 : 0)
    })
  }

  function selected(kind, from, to) {
    clear()
    for (const box of boxes(kind)) { box.left = from; box.right = to; box.visible = true }
    const w = weights(kind, from, to), total = w.reduce((a, b) => a + b, 0)
    if (!(total > 0)) return
    if (kind !== "time") put("blocks", {...model("blocks").data, weight: Float32Array.from(w, (x) => 0.65 * x)})
    if (kind !== "band")
      put("picked_spectrum", {f: column("lines", "f"), y: sums("lines", "p", w).map((x) => Math.sqrt(x / total))})
    for (const other of ["u", "v"]) if (other !== kind) put(`picked_${other}`, curve(other, w))
    put("plane", {...model("plane").data, picked: cells(kind, from, to, w)})
    for (const name of ["spectrum", "against_u", "against_v"])
      entry(name, "selected", model(`picked_${name.split("_")[1] ?? name}`).get_length() > 0)
    if (kind === "time") closer(from, to)
    tell(kind, from, to)
  }

  // the close-up moves to a stretch that was selected
  let far = null
  function closer(from, to) {
    const t = column("time", "t"), first = t.findIndex((x) => x >= from), last = t.findLastIndex((x) => x <= to)
    if (last - first < 2) return
    far ??= model("close").data
    const cut = (key) => column("time", key).slice(first, last + 1)
    put("close", {t: cut("t"), measured: cut("measured"), predicted: cut("predicted")})
  }

  function tell(kind, from, to) {
    const axis = {time: "difference_x", band: "spectrum_x", u: "against_u_x", v: "against_v_x"}[kind]
    const [quantity, unit] = model(axis).axis_label.split(" / ")
    const element = place("selection")
    if (!element) return
    element.textContent = `Selected: ${quantity} from ${Number(from.toPrecision(3))} to ${Number(to.toPrecision(3))} ${unit}; ` +
      "all panels show what belongs to it. Escape clears."
    element.classList.add("on")
  }

  // what is drawn anew takes time: only what changes is
  const any = (source, key) => source.get_column(key).some((x) => x !== 0)
  const empty = (name, columns) => { if (model(name).get_length() > 0) put(name, columns) }

  function clear() {
    for (const kind in KINDS) for (const box of boxes(kind)) box.visible = false
    const blocks = model("blocks"), plane = model("plane")
    if (any(blocks, "weight")) put("blocks", {...blocks.data, weight: new Float32Array(blocks.get_length() ?? 0)})
    if (any(plane, "picked")) put("plane", {...plane.data, picked: new Float32Array(plane.get_length() ?? 0)})
    empty("picked_spectrum", {f: [], y: []})
    for (const kind of ["u", "v"]) empty(`picked_${kind}`, {at: [], y: []})
    for (const name of ["spectrum", "against_u", "against_v"]) entry(name, "selected", false)
    if (far !== null) put("close", far)
    far = null
    const element = place("selection")
    if (element) { element.textContent = element.dataset.hint; element.classList.remove("on") }
  }

  // ---- steps and records of a saved page
  let present = null
  const pressed = () => document.querySelector("[data-act=record][aria-pressed=true]")?.dataset.name ?? "0"
  const last = () => Math.max(0, all("[data-act=step]").length - 1)
  function step(k) { show(k, pressed()) }
  function show(k, record) {
    present = k
    pull(`${k}.${record}`)
    words()
    for (const button of all("[data-act=step]")) button.classList.toggle("now", button.dataset.name === String(k))
  }

  // ---- axes of frequency, linear or logarithmic
  function logarithm(button) {
    const on = button.getAttribute("aria-pressed") !== "true", range = model("range_frequency")
    button.setAttribute("aria-pressed", String(on))
    range.start = on ? range.tags[0] : 0
    for (const {dataset: {panel}} of all("[data-panel]")) {
      const figure = model(`panel_${panel}`)
      if (figure.x_range !== range) continue
      figure.x_scale = new (Bokeh.Models.get(on ? "LogScale" : "LinearScale"))()
      model(`${panel}_x`).ticker = on ? model("frequency_decades") : model("frequency_even")
    }
  }

  // ---- the numbers of a panel as a file
  const DRAWN = {
    history: ["history"], response: ["time"], close: ["close"], force: ["force"], coherence: ["coherence"],
    spectrum: ["spectrum"], plane: ["plane"], against_u: ["against_u"], against_v: ["against_v"], frf: ["frf"],
    phase: ["frf"], linearity: ["frf"], loop_u: ["loops"], loop_v: ["loops"], cycles: ["cycles"],
    decay_frequency: ["decay", "decay_model"], decay_damping: ["decay", "decay_model"],
    autocorrelation: ["autocorrelation"], with_force: ["with_force"], histogram: ["histogram"], constancy: ["shown"],
    sensors: ["sensors"], lacking: ["lacking"], stiffness: ["stiffness"],
  }

  function table(name) {
    const data = model(name).data, keys = Object.keys(data), rows = []
    const cells = (value) => value != null && typeof value !== "string" && value.length !== undefined ? Array.from(value).join(" ") : value
    for (let i = 0; i < model(name).get_length(); i++) rows.push(keys.map((key) => `"${String(cells(data[key][i])).replace(/"/g, '""')}"`.replace(/^"(-?[0-9.e+-]+)"$/, "$1")))
    return [keys, ...rows].map((row) => row.join(",")).join("\n") + "\n"
  }

  function exported(panel) {
    const units = [`${panel}_x`, `${panel}_y`].map((name) => model(name)?.axis_label).filter(Boolean).join("; ")
    const link = document.createElement("a")
    link.href = URL.createObjectURL(new Blob([`# ${units}\n`, ...DRAWN[panel].map(table)], {type: "text/csv"}))
    link.download = `${document.title.replace(/[^\w]+/g, "_")}_${panel}.csv`
    link.click()
    setTimeout(() => URL.revokeObjectURL(link.href), 1000)
  }

  function buttons() {
    for (const shown of all("[data-panel]")) {
      const panel = shown.dataset.panel, near = [shown.closest(".panel"), shown.closest(".card")]
      const heading = near.map((place) => place?.querySelector(":scope > h2")).find(Boolean)
      if (!heading || heading.querySelector(`[data-name=${panel}]`) || !DRAWN[panel]) continue
      const button = document.createElement("button"), label = heading.querySelector(".csv") ? "CSV of the close-up" : "CSV"
      Object.assign(button, {className: "csv", textContent: label, title: "the numbers of this panel as a file"})
      Object.assign(button.dataset, {act: "csv", name: panel})
      if (!heading.querySelector(".csvs")) heading.append(Object.assign(document.createElement("span"), {className: "csvs"}))
      heading.querySelector(".csvs").append(button)
    }
  }

  // ---- panels are drawn one by one: first those in view, then, while nothing else is done, whichever is next to it
  const waiting = () => [...all("[data-panel]:not(.drawn)")]
  const next = () => new Promise((done) => requestIdleCallback(done, {timeout: 1000}))

  function beyond(shown) {
    const box = shown.getBoundingClientRect()
    return Math.max(0, box.top - innerHeight, -box.bottom)  // pixels from the view
  }

  // ---- what is out of view is painted anew when it comes near it, or after what is in view
  const views = new Map(), resting = new Set(), NEAR = 200, SETTLED = 1500  // pixels; milliseconds
  const SLIM = "(max-width: 1080px)", SHEET = [733, 1062]  // as in page.css; pixels: A4 within its margins
  function rest(shown, on) {
    if (on === resting.has(shown)) return
    resting[on ? "add" : "delete"](shown)
    if (on) views.get(shown).pause()
    else views.get(shown).unpause()
  }
  const watched = new IntersectionObserver(
    (all) => { for (const {target, isIntersecting} of all) rest(target, !isIntersecting) }, {rootMargin: `${NEAR}px`})
  const frame = () => new Promise(requestAnimationFrame)

  let round = 0
  async function catch_up() {
    const mine = ++round
    for (const shown of [...resting]) {
      await next()
      rest(shown, false)
      await frame()
      await frame()
      rest(shown, beyond(shown) > NEAR)
      if (mine !== round) return
    }
  }
  addEventListener("beforeprint", () => {
    for (const shown of [...resting]) rest(shown, false)
    const {body} = document, wide = document.documentElement.clientWidth, slim = matchMedia(SLIM).matches
    body.classList.toggle("slim", slim)  // in one column, on as many sheets as it takes; else on one
    body.style.setProperty("--printed", Math.min(SHEET[0] / wide, slim ? 1 : SHEET[1] / body.scrollHeight))
    body.style.setProperty("--window", `${wide}px`)
  })

  async function draw(shown) {
    shown.classList.add("drawn")
    const view = await Bokeh.documents[0].views_manager.build_view(model(`panel_${shown.dataset.panel}`))
    view.build(shown)
    shown.style.height = ""
    untabbed(shown)  // and its tools, which come later
    views.set(shown, view)
    setTimeout(() => { untabbed(shown); watched.observe(shown) }, SETTLED)
  }

  async function draw_rest() {
    for (let left = waiting(); left.length; left = waiting()) {
      await next()
      await draw(left.reduce((a, b) => (beyond(b) < beyond(a) ? b : a)))
    }
    window.study.drawn = true
  }

  // Tools of the panels are for the mouse: the Tab key goes from one action to the next.
  function untabbed(root) {
    for (const element of root.querySelectorAll("*")) {
      if (element.tabIndex >= 0) element.tabIndex = -1
      if (element.shadowRoot) untabbed(element.shadowRoot)
    }
  }

  // ---- what is clicked goes to Python
  let count = 0
  const ask = (action, name) => put("asked", {act: [action], name: [String(name)], count: [++count]})
  function act(action, name) {
    if (action === "step") return step(Number(name))
    if (action === "record" && !model("asked")) return show(present ?? last(), name)
    if (action === "csv") return exported(name)
    if (action === "sensor") return choose(() => { seen.sensor = name })
    if (action === "logarithm") return logarithm(document.querySelector("[data-act=logarithm]"))
    if (action === "save") name = place("with-values").checked ? "values" : "open"
    if (document.body.classList.contains("busy") && action !== "try") return
    ask(action, name)
  }

  function state() {
    const shown = (key) => column("state", key)[0]
    document.body.classList.toggle("busy", shown("busy") !== "")
    for (const [id, key] of [["busy", "doing"], ["answer", "answer"], ["notice", "notice"]]) {
      const element = place(id)
      if (element) element.textContent = shown(key)
    }
    document.body.classList.toggle("working", shown("doing") !== "")
    const undo = document.querySelector("[data-act=undo]")
    if (undo) undo.disabled = !shown("undo")
    const field = place("formula")
    if (field) {
      field.setAttribute("aria-invalid", shown("answer") !== "" ? "true" : "false")
      if (shown("accepted") && field.value === shown("accepted")) field.value = ""
    }
  }

  let hovered = null
  const under = (event, key) => event.composedPath().find((e) => e.dataset && e.dataset[key] !== undefined)
  const pointed = (event) => { const row = under(event, "candidate"); return row ? Number(row.dataset.candidate) : null }

  // a click on a candidate pins it and turns to its place; one on a connection of the sketch turns to that
  function clicked(event) {
    const link = event.target.closest?.("#sketch [data-place]"), candidate = pointed(event)
    if (link) select(link.dataset.place)
    if (candidate === null) return
    const at = row(candidate).dataset.at
    if (at !== undefined && at !== seen.place) select(at)
    pin(candidate)
  }
  document.addEventListener("click", (event) => {
    if (!window.study.ready) return  // words are there before what draws them anew
    const element = under(event, "act")
    if (!element) return clicked(event)
    if (!element.disabled)
      act(element.dataset.act, element.dataset.act === "try" ? place("formula").value : element.dataset.name ?? "")
  })
  document.addEventListener("mouseover", (event) => {
    const next = pointed(event)
    if (next !== hovered && place("candidates") && window.study.ready) preview((hovered = next))
  })
  document.addEventListener("focusin", (event) => {
    if (pointed(event) !== null && window.study.ready) preview((hovered = pointed(event)))
  })
  document.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && event.target.id === "formula") act("try", event.target.value)
    if (event.key === "Escape") { clear(); hovered = null; for (const i of pins) pin(i); preview(null) }
    if ((event.key === "Enter" || event.key === " ") && event.target.matches?.("#sketch [data-place], [data-candidate]")) {
      event.preventDefault()
      clicked(event)
    }
  })

  const begin = async () => {
    window.study.words()
    if (model("state")) { state(); ask("hello", "") }
    buttons()
    for (const shown of waiting()) if (beyond(shown) === 0) await draw(shown)
    window.study.ready = true
    await draw_rest()
  }
  return {words, settled, step, begin, state, selected, clear, DRAWN, ready: false, drawn: false}
})()
