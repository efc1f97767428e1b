#include "global_map_builder/map_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/file_io.h"
#include "global_map_builder/map_picture.h"

namespace knav {
namespace {

constexpr std::size_t kPictures = 400;  // a thumbnail has about 2 kB

std::string base64(const std::vector<unsigned char>& bytes) {
  static const char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += k <= count ? kDigits[group >> (18 - 6 * k) & 63u] : '=';
  }
  return out;
}

std::string picture(const std::vector<unsigned char>& png, const std::string& alternative) {
  return fmt::format("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", alternative, base64(png));
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

const char* const kStyle = R"(<style>
body{font-family:sans-serif;margin:2em;max-width:1500px}
table{border-collapse:collapse}td,th{border:1px solid #bbb;padding:3px 8px;text-align:right;vertical-align:top}
td.t,th.t{text-align:left}tr.no{background:#fbe9f4}tr.yes{background:#eef8ee}
img.map{max-width:100%;border:1px solid #888}.pair{display:flex;gap:1em;flex-wrap:wrap}.pair figure{flex:1 1 45%;margin:0}
button{font-size:1em;padding:.4em 1em}</style>
)";

const char* const kScript = R"(<script>
function saveList(){
 let text='closures:\n';let rows=document.querySelectorAll('tr[data-entry]');
 for(const row of rows)text+='  - {'+row.dataset.entry+', verdict: '+row.querySelector('select').value+'}\n';
 if(!rows.length)text+='  []\n';
 const a=document.createElement('a');a.href=URL.createObjectURL(new Blob([text],{type:'text/yaml'}));
 a.download='closures.yaml';a.click();}
</script>
)";

std::string choice(const std::string& verdict) {
  std::string out = "<select>";
  for (const char* name : {"auto", "allow", "deny"}) {
    const bool chosen = verdict == name || (verdict.empty() && name == std::string("auto"));
    out += fmt::format("<option{}>{}</option>", chosen ? " selected" : "", name);
  }
  return out + "</select>";
}

std::string row(const MapRecord& record, const Closure& c, std::size_t number, bool with_picture) {
  const double start_s = record.drives.front().trajectory.front().stamp_s;
  const Keyframe &from = record.keyframe(c.from), &to = record.keyframe(c.to);
  const std::string entry = fmt::format(
      "drives: [{}, {}], from_stamp_s: {:.6f}, to_stamp_s: {:.6f}, x_m: {:.4f}, y_m: {:.4f}, yaw_rad: {:.5f}",
      record.drive_of(c.from), record.drive_of(c.to), from.stamp_s, to.stamp_s, c.match.T_from_to.x_m,
      c.match.T_from_to.y_m, c.match.T_from_to.yaw_rad);
  const std::string shown = with_picture && !c.from_points.empty()
                                ? picture(closure_thumbnail(c), fmt::format("closure {}", number))
                                : "";
  const auto when = [&](int keyframe, const Keyframe& k) {
    return fmt::format("drive {}, {:.1f} s, {:.1f} m", record.drive_of(keyframe), k.stamp_s - start_s,
                       k.path_m);
  };
  return fmt::format(
      "<tr class=\"{}\" data-entry=\"{}\"><td>{}</td><td class=t>{}</td><td class=t>{}</td><td "
      "class=t>{}</td>"
      "<td>{:.3f}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.1f}</td><td>{:.2f}</td><td>{:.1f}</"
      "td>"
      "<td class=t>{}</td><td class=t>{}</td><td>{}</td></tr>\n",
      c.accepted ? "yes" : "no", entry, number, c.source, when(c.from, from), when(c.to, to),
      c.match.residual_m, c.match.score, c.match.overlap, c.match.agreement, c.match.surface_m, c.match.rival,
      c.chi2, c.accepted ? "accepted" : "refused: " + escaped(c.reason), choice(c.verdict), shown);
}

std::string changes_section(const BuiltMap& built) {
  std::string text = "<h2>What changed</h2>\n<p>Red came, blue went.</p>\n";
  text += fmt::format("<figure><img class=map alt=\"changes\" src=\"data:image/png;base64,{}\"></figure>\n",
                      base64(changes_picture(built)));
  text +=
      "<table><tr><th class=t>now</th><th>x [m]</th><th>y [m]</th><th>size [m]</th><th>surface "
      "[m]</th></tr>\n";
  for (const MapChange& change : built.changes) {
    text += fmt::format(
        "<tr><td class=t>{}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.2f} x {:.2f}</td><td>{:.2f}</td></tr>\n",
        change.occupied ? "occupied" : "free", change.x_m, change.y_m, change.width_m, change.height_m,
        change.wall_m);
  }
  return text + "</table>\n";
}

}  // namespace

void write_map_report(const std::string& path, const BuiltMap& built, const std::string& title,
                      const std::vector<std::pair<std::string, std::string>>& figures) {
  std::string text = "<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8><title>" + escaped(title) +
                     "</title>\n" + kStyle + "</head><body>\n<h1>" + escaped(title) + "</h1>\n<table>\n";
  for (const auto& [name, value] : figures) {
    text += fmt::format("<tr><th class=t>{}</th><td class=t>{}</td></tr>\n", escaped(name), escaped(value));
  }
  text +=
      "</table>\n<h2>The map</h2>\n<p>The drive from blue to red; closures green, refused ones magenta. "
      "Doubled "
      "walls mean a missing or a wrong closure.</p>\n<div class=pair>\n";
  const auto figure = [&](const char* caption, const std::vector<unsigned char>& png) {
    text += fmt::format(
        "<figure><img class=map alt=\"{0}\" "
        "src=\"data:image/png;base64,{1}\"><figcaption>{0}</figcaption></figure>\n",
        caption, base64(png));
  };
  if (!built.before.value.empty()) figure("before: as the local mapper drove it", before_picture(built));
  figure("after: the map", map_picture(built));
  text += "</div>\n";
  if (built.old_drives > 0) text += changes_section(built);
  text +=
      "<h2>Closures</h2>\n<p>Pictures: the earlier visit's walls black, the later one's laid on them red. To "
      "overrule the builder: choose <i>allow</i> or <i>deny</i>, save the list, and give it to "
      "<code>build_map "
      "--closures closures.yaml</code>.</p>\n<p><button onclick=\"saveList()\">save "
      "closures.yaml</button></p>\n"
      "<table><tr><th></th><th class=t>found by</th><th class=t>earlier</th><th "
      "class=t>later</th><th>residual "
      "[m]</th><th>score</th><th>overlap</th><th>agreement</th><th>wall [m]</th><th>rival</th><th>chi2</th>"
      "<th class=t>verdict</th><th class=t>list</th><th></th></tr>\n";
  for (std::size_t i = 0; i < built.record.closures.size(); ++i) {
    text += row(built.record, built.record.closures[i], i + 1, i < kPictures);
  }
  text += "</table>\n";
  text += kScript;
  text += "</body></html>\n";
  write_text_atomically(path, text);
}

}  // namespace knav
