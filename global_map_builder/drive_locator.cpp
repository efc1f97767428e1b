// ClosureFinder's part that finds one drive in the others, wherever it began.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "global_map_builder/closure_finder.h"

namespace knav {
namespace {

/// How far two statements about a drive's place may part: its own drift between the two places comes on top.
constexpr double kAgree_m = 0.4;
constexpr double kAgree_rad = 0.09;
constexpr double kTurn_m = 1.0;            // metres that a radian counts for
constexpr double kDriftPath_m = 20.0;      // the heading's drift is not counted beyond
constexpr double kComparable = 0.15;       // overlap from which two local maps say something of each other
constexpr double kMostAstray = 0.15;       // share of walls that may lie where the map has none
constexpr double kMuchMoreAstray = 1.5;    // a place where so many times more lie astray is no rival
constexpr std::size_t kMostAsked = 16;     // places of the new drive that are looked for everywhere
constexpr std::size_t kMostVerified = 12;  // places where the drive may lie

}  // namespace

/// Keyframes [first, last) every so far along the path, and the last one.
std::vector<int> ClosureFinder::spread(int first, int last, double spacing_m) const {
  std::vector<int> out;
  double next_m = -1e300;
  for (int node = first; node < last; ++node) {
    if (path_m(node) < next_m) continue;
    out.push_back(node);
    next_m = path_m(node) + spacing_m;
  }
  return out;
}

void ClosureFinder::prepare_submaps(const std::vector<int>& keyframes) {
  std::vector<int> missing;
  for (const int node : keyframes) {
    if (submaps_.try_emplace(node).second) missing.push_back(node);
  }
  // Every task fills an entry of its own; the map itself does not change.
  tbb::parallel_for(std::size_t{0}, missing.size(), [&](std::size_t i) { make_submap(missing[i]); });
}

/// Whether two hypotheses put the drive at the same place, given the drift between where they were taken.
bool ClosureFinder::agree(const Hypothesis& h, const Hypothesis& with) const {
  const Pose2 here = graph_.nodes.at(h.to);  // in the drive's own frame
  const Pose2 a = h.T_map_drive * here, b = with.T_map_drive * here;
  const double way_m = std::fabs(path_m(h.to) - path_m(with.to));
  return distance_m(a, b) <= kAgree_m + config_.closures.search_per_m * way_m &&
         std::fabs(normalize_angle_rad(a.yaw_rad - b.yaw_rad)) <=
             kAgree_rad +
                 config_.closures.search_angle_deg_per_m * kPi / 180.0 * std::min(way_m, kDriftPath_m);
}

/// The hypotheses that put the drive where `with` does, one for each place of the drive.
std::vector<ClosureFinder::Hypothesis> ClosureFinder::agreeing(const std::vector<Hypothesis>& found,
                                                               const Hypothesis& with) const {
  std::vector<Hypothesis> out;
  for (const Hypothesis& h : found) {
    if (!agree(h, with)) continue;
    const bool same = !out.empty() && out.back().to == h.to;
    if (same && out.back().match.score >= h.match.score) continue;
    if (same) out.pop_back();
    out.push_back(h);
  }
  return out;
}

void ClosureFinder::move_drive(int drive, const Pose2& T_map_drive) {
  for (int node = set_.first(drive); node < set_.first(drive + 1); ++node) {
    graph_.nodes[node] = T_map_drive * graph_.nodes.at(node);
  }
}

/// Puts the whole drive where a hypothesis says, and looks at each of its places whether the map there
/// agrees.
ClosureFinder::Location ClosureFinder::verify(const Hypothesis& h, const std::vector<int>& places,
                                              const std::vector<int>& asked) const {
  const ClosureConfig& c = config_.closures;
  struct Look {
    Hypothesis match;
    bool agrees = false, contradicts = false;
  };
  std::vector<Look> looks(asked.size());
  tbb::parallel_for(std::size_t{0}, asked.size(), [&](std::size_t i) {
    const Pose2 here = h.T_map_drive * graph_.nodes.at(asked[i]);
    // The nearest, one that looked the same way rather than one that did not: the camera sees 57 degrees.
    const auto apart = [&](int place) {
      const Pose2& there = graph_.nodes.at(place);
      return distance_m(there, here) + kTurn_m * std::fabs(normalize_angle_rad(there.yaw_rad - here.yaw_rad));
    };
    const int place =
        *std::min_element(places.begin(), places.end(), [&](int a, int b) { return apart(a) < apart(b); });
    const Pose2 T_place_here = graph_.nodes.at(place).inverse() * here;
    if (distance_m(T_place_here, {}) > 1.5 * c.locate_spacing_m) return;
    const double way_m = std::fabs(path_m(asked[i]) - path_m(h.to));
    const MatchWindow window{
        kAgree_m + c.search_per_m * way_m,
        kAgree_rad + c.search_angle_deg_per_m * kPi / 180.0 * std::min(way_m, kDriftPath_m)};
    Look& look = looks[i];
    look.match = {place, asked[i], {}, {}};
    look.match.match =
        match_submaps(c.match, *submaps_.at(place), *submaps_.at(asked[i]), T_place_here, window);
    const MatchResult& match = look.match.match;
    look.match.T_map_drive = graph_.nodes.at(place) * match.T_from_to * graph_.nodes.at(asked[i]).inverse();
    look.agrees = match.accepted;
    look.contradicts =
        !match.accepted && match.overlap >= c.match.min_overlap && match.agreement < c.match.min_agreement;
  });
  Location location;
  location.T_map_drive = h.T_map_drive;
  double seen_m = 0.0, astray_m = 0.0;
  for (const Look& look : looks) {
    if (look.agrees) location.agreeing.push_back(look.match);
    location.contradicting += look.contradicts;
    const MatchResult& match = look.match.match;
    if (match.overlap < kComparable || !(match.agreement > 0.0)) continue;
    seen_m += match.surface_m / match.agreement;
    astray_m += match.surface_m / match.agreement * (1.0 - match.agreement);
  }
  location.astray = seen_m > 0.0 ? astray_m / seen_m : 1.0;
  return location;
}

/// Lays places along the drive on all places of the drives before, in any direction. A single match may be a
/// look-alike. Each place where matches would put the drive is therefore tried with the whole drive: the
/// right one is agreed to all along it.
void ClosureFinder::locate(int drive) {
  const int first = set_.first(drive), last = set_.first(drive + 1);
  const bool joined = std::any_of(closures_.begin(), closures_.end(), [&](const Closure& c) {
    return c.accepted && c.from < first && c.to >= first && c.to < last;
  });
  if (joined) return;  // by the list
  const ClosureConfig& c = config_.closures;
  const std::vector<int> places = spread(0, first, c.locate_spacing_m);
  const std::vector<int> asked = spread(first, last, c.locate_spacing_m);
  prepare_submaps(places);
  prepare_submaps(asked);
  std::vector<Hypothesis> found;
  const MatchWindow anywhere{1.5 * c.locate_spacing_m, kPi};
  const std::size_t stride = 1 + asked.size() / kMostAsked;
  for (std::size_t i = 0; i < asked.size(); i += stride) {
    progress_(static_cast<double>(i) / static_cast<double>(asked.size()));
    std::vector<MatchResult> matches(places.size());
    tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t k) {
      matches[k] = match_submaps(c.match, *submaps_.at(places[k]), *submaps_.at(asked[i]), {}, anywhere);
    });
    for (std::size_t k = 0; k < places.size(); ++k) {
      if (!matches[k].accepted) continue;
      found.push_back(
          {places[k], asked[i], matches[k],
           graph_.nodes.at(places[k]) * matches[k].T_from_to * graph_.nodes.at(asked[i]).inverse()});
    }
  }
  std::vector<Location> locations;
  for (const Hypothesis& h : distinct(found)) locations.push_back(verify(h, places, asked));
  std::stable_sort(locations.begin(), locations.end(),
                   [](const Location& a, const Location& b) { return a.worth() > b.worth(); });
  judge_location(drive, found.size(), locations);
}

/// Of hypotheses that put the drive at the same place one, those with most company first.
std::vector<ClosureFinder::Hypothesis> ClosureFinder::distinct(const std::vector<Hypothesis>& found) const {
  std::vector<std::pair<std::size_t, const Hypothesis*>> ranked;
  for (const Hypothesis& h : found) ranked.emplace_back(agreeing(found, h).size(), &h);
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Hypothesis> out;
  for (const auto& [company, h] : ranked) {
    if (out.size() == kMostVerified) break;
    const bool there =
        std::any_of(out.begin(), out.end(), [&, h = h](const Hypothesis& o) { return agree(*h, o); });
    if (!there) out.push_back(*h);
  }
  return out;
}

/// In order of how far they part from the middle one of the others. A look-alike may agree as far as the drive may have drifted.
std::vector<ClosureFinder::Hypothesis> ClosureFinder::most_central_first(const std::vector<Hypothesis>& agreeing) const {
  std::vector<std::pair<double, const Hypothesis*>> ranked;
  std::vector<double> apart;
  for (const Hypothesis& h : agreeing) {
    const Pose2 here = graph_.nodes.at(h.to);
    apart.clear();
    for (const Hypothesis& other : agreeing) {
      apart.push_back(distance_m(h.T_map_drive * here, other.T_map_drive * here));
    }
    const auto middle = apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 2);
    std::nth_element(apart.begin(), middle, apart.end());
    ranked.emplace_back(*middle, &h);
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Hypothesis> out;
  for (const auto& [apart_m, h] : ranked) out.push_back(*h);
  return out;
}

void ClosureFinder::judge_location(int drive, std::size_t found, const std::vector<Location>& locations) {
  const Location best = locations.empty() ? Location{} : locations[0];
  const int agreeing = static_cast<int>(best.agreeing.size());
  // What speaks for another place and not for this one.
  int rival = 0;
  for (const Location& other : locations) {
    if (other.astray > kMuchMoreAstray * best.astray) continue;
    int against = 0;
    for (const Hypothesis& h : other.agreeing) {
      against += std::none_of(best.agreeing.begin(), best.agreeing.end(),
                              [&](const Hypothesis& b) { return agree(h, b); });
    }
    rival = std::max(rival, against);
  }
  if (agreeing < config_.closures.locate_agreeing || agreeing < 2 * best.contradicting ||
      agreeing < 2 * rival || best.astray > kMostAstray) {
    throw UserError(
        fmt::format("{}: shares no place with the map that could be told for sure: {} views of it look like "
                    "places there; where "
                    "it would fit best {} of its places agree ({} are asked for), {} contradict and {:.0f} % "
                    "of the walls lie astray; "
                    "elsewhere {} agree as well. "
                    "Is it another building? Nothing was written.",
                    set_.drives()[static_cast<std::size_t>(drive)].name, found, agreeing,
                    config_.closures.locate_agreeing, best.contradicting, 100.0 * best.astray, rival));
  }
  move_drive(drive, best.T_map_drive);
  // The first one joined bends nothing, whatever it says, and the others are held against it.
  for (const Hypothesis& h : most_central_first(best.agreeing)) {
    Closure closure;
    closure.from = h.from;
    closure.to = h.to;
    closure.source = "located";
    closure.matched = true;
    closure.match = h.match;
    join(std::move(closure), {h.from, h.to, h.match.T_from_to, h.match.information, true});
  }
}

}  // namespace knav
