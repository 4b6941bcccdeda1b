// The page of one coordinate: previews of candidates, and selections that join its panels.
;(() => {
  const {stage, follow, said, under, model, column, put, place} = window.study

  // ---- what one candidate would leave, or two: one that is pinned beside the one that is pointed at, or two pinned
  let kept = null, pins = []
  function preview(i) {
    const [first, second] = pins
    const shown = second ?? i ?? first ?? null, beside = first !== undefined && first !== shown ? first : null
    drawn("ghost", "candidate", shown)
    drawn("pinned", "pinned", beside)
    const has = known(shown)
    if (has && kept === null) kept = column("plane", "mean")
    if (kept !== null) {
      const mean = has ? column("would_plane", String(shown)) : kept
      put("plane", {...model("plane").data, mean, below: Float32Array.from(mean, (m) => (m < -1e-6 * model("mapper").high ? 5 : 0))})
      if (!has) kept = null
    }
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
  const title = (i) => document.querySelector(`[data-candidate="${i}"] .name b`)?.textContent ?? "candidate"

  // a click on a candidate pins it, another one lets it go; of three the first goes
  function pin(i) {
    pins = pins.includes(i) ? pins.filter((other) => other !== i) : [...pins, i].slice(-2)
    for (const row of document.querySelectorAll("[data-candidate]")) {
      row.classList.toggle("pinned", pins.includes(Number(row.dataset.candidate)))
      row.classList.toggle("second", pins[1] === Number(row.dataset.candidate))
    }
    preview(hovered)
  }

  const entry = (name, label, on) => { const item = model(`panel_${name}_${label}`); if (item) item.visible = on }

  const row = (i) => document.querySelector(`[data-candidate="${i}"]`)

  function constancy(i, beside) {
    const element = row(i), keep = []
    if (element) column("constancy", "row").forEach((value, k) => { if (value === i) keep.push(k) })
    follow(element, "constancy", keep, title(i))
    if (beside !== null) place("detail").innerHTML = `<div class="two"><p>${said(row(beside))}</p><p>${said(element)}</p></div>`
  }

  // ---- selections: whatever is selected weighs the blocks of time, and these weigh everything else
  const KINDS = {
    time: ["box_response", "box_difference"], band: ["box_force", "box_coherence", "box_spectrum"],
    u: ["box_against_u"], v: ["box_against_v"],
  }

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
    for (const name of KINDS[kind]) { const box = model(name); box.left = from; box.right = to; box.visible = true }
    const w = weights(kind, from, to), total = w.reduce((a, b) => a + b, 0)
    if (!(total > 0)) return
    if (kind !== "time") put("blocks", {...model("blocks").data, weight: Float32Array.from(w, (x) => 0.65 * x)})
    if (kind !== "band")
      put("picked_spectrum", {f: column("lines", "f"), y: sums("lines", "p", w).map((x) => Math.sqrt(x / total))})
    for (const other of ["u", "v"]) if (other !== kind) put(`picked_${other}`, curve(other, w))
    put("plane", {...model("plane").data, picked: cells(kind, from, to, w)})
    for (const name of ["spectrum", "against_u", "against_v"])
      entry(name, "selected", model(`picked_${name.split("_")[1] ?? name}`).get_length() > 0)
    if (kind === "time") near(from, to)
    tell(kind, from, to)
  }

  // the close-up moves to a stretch that was selected
  let far = null
  function near(from, to) {
    const t = column("time", "t"), first = t.findIndex((x) => x >= from), last = t.findLastIndex((x) => x <= to)
    if (last - first < 2) return
    far ??= model("close").data
    const cut = (key) => column("time", key).slice(first, last + 1)
    put("close", {t: cut("t"), measured: cut("measured"), predicted: cut("predicted")})
  }

  function tell(kind, from, to) {
    const axis = {time: "difference_x", band: "force_x", u: "against_u_x", v: "against_v_x"}[kind]
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
    for (const names of Object.values(KINDS)) for (const name of names) model(name).visible = false
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

  // ---- another model: what was selected or pinned belongs to the one before
  function words() {
    stage()
    far = null
    clear()
    kept = null
    pins = []
    preview(null)
  }

  let hovered = null
  document.addEventListener("click", (event) => {
    const candidate = under(event, "candidate")
    if (candidate && window.study.ready && !under(event, "act")) pin(Number(candidate.dataset.candidate))
  })
  document.addEventListener("mouseover", (event) => {
    const element = under(event, "candidate"), next = element ? Number(element.dataset.candidate) : null
    if (next !== hovered && place("candidates") && window.study.ready) preview((hovered = next))
  })
  document.addEventListener("focusin", (event) => {
    const element = under(event, "candidate")
    if (element && window.study.ready) preview((hovered = Number(element.dataset.candidate)))
  })
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") { clear(); hovered = null; for (const i of pins) pin(i); preview(null) }
    if ((event.key === "Enter" || event.key === " ") && event.target.dataset?.candidate !== undefined) {
      event.preventDefault()
      pin(Number(event.target.dataset.candidate))
    }
  })

  Object.assign(window.study, {words, selected, clear})
})()
