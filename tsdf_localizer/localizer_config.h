#pragma once

#include <string>
#include <vector>

#include "core/motion_model.h"

namespace knav {

/// The price of a reading, from the distance map (paper equation 7, normalised; section III.H).
struct MeasurementConfig {
  double truncation_m = 0.5;
  double unknown_cost = 0.5;
  double temperature = 0.006;
  double evidence_min = 0.02;
  double evidence_power = 1.0;
  double evidence_power_tracked = 8.0;
  double evidence_decay_s = 30.0;
  double noise_m = 0.05;
  double noise_per_range_squared = 0.002;
  double fresh_after_m = 0.3;
  double fresh_after_rad = 0.3;
  double fresh_after_s = 5.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("truncation_m", truncation_m, 0.05, 5, "m",
             "Distance from the nearest wall at which a reading costs all it can.");
    v.number("unknown_cost", unknown_cost, 0, 1, "",
             "Price of a reading that falls where the map knows nothing (0 on a wall, 1 far from any).");
    v.number("temperature", temperature, 0.0005, 1, "",
             "Rise of the mean price that makes a pose e times less likely, for a scan of all new evidence.");
    v.number("evidence_min", evidence_min, 0, 1, "",
             "Rays with less evidence (intensities of scan_360) are left out.");
    v.number("evidence_power", evidence_power, 0, 10, "",
             "A ray weighs its evidence to this power while the pose is in doubt, ...");
    v.number("evidence_power_tracked", evidence_power_tracked, 0, 20, "",
             "... and to this one while it is not: what is old has had its say, and has moved with the local map's drift.");
    v.number("evidence_decay_s", evidence_decay_s, 0.1, 10000, "s",
             "After how long without a view the scan's evidence has fallen to 1/e (local_mapper's contour/evidence_decay_s).");
    v.number("noise_m", noise_m, 0.005, 1, "m",
             "Noise (sd) of a near reading; sets the weight of far ones beside it.");
    v.number("noise_per_range_squared", noise_per_range_squared, 0, 0.1, "1/m",
             "Noise (sd) of a far reading per squared range; 0 for a laser scanner.");
    v.number("fresh_after_m", fresh_after_m, 0.01, 10, "m",
             "Distance driven after which a scan counts as all new evidence.");
    v.number("fresh_after_rad", fresh_after_rad, 0.01, 10, "rad",
             "Angle turned after which a scan counts as all new evidence.");
    v.number("fresh_after_s", fresh_after_s, 0.05, 1000, "s",
             "Time after which a scan counts as all new evidence.");
  }
};

/// Which rays the map explains, and when the pose is to be trusted.
struct HealthConfig {
  double explained_m = 0.05;
  double explained_per_range = 0.012;
  double full_range_m = 3.0;
  double body_radius_m = 0.2;
  double taken_away_m = 1.5;
  double ok_fraction = 0.60;
  double fresh_ok_fraction = 0.60;
  double lost_fraction = 0.40;
  double smoothing_s = 0.7;
  double lost_after_s = 1.5;
  double ok_position_sd_m = 0.35;
  double ok_yaw_sd_rad = 0.25;
  double ok_cluster_weight = 0.85;
  int rays_min = 40;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("explained_m", explained_m, 0.02, 2, "m",
             "A reading this near to a wall of the map is explained by it, ...");
    v.number("explained_per_range", explained_per_range, 0, 0.5, "m/m",
             "... plus this much per metre of range.");
    v.number("full_range_m", full_range_m, 0, 100, "m",
             "A ray shorter than this counts in proportion to its length: half of all rays may meet one thing beside the robot, which was moved "
             "there or taken away. 0 = all count the same.");
    v.number("body_radius_m", body_radius_m, 0, 5, "m",
             "What the map has nearer than this to a robot that drove there has been taken away, as the robot stands in its place: it hides "
             "nothing. 0 = a robot that stands there sees nothing but through walls.");
    v.number("taken_away_m", taken_away_m, 0, 20, "m", "How far from the robot such a thing reaches at most.");
    v.number("ok_fraction", ok_fraction, 0, 1, "",
             "Smoothed fraction of explained rays below which the verdict is no longer ok.");
    v.number("fresh_ok_fraction", fresh_ok_fraction, 0, 1, "",
             "The same, of the rays seen just now; a view that ends in front of every wall scores 0.5.");
    v.number("lost_fraction", lost_fraction, 0, 1, "",
             "Smoothed fraction of explained rays below which the robot is lost.");
    v.number("smoothing_s", smoothing_s, 0, 10, "s", "Time constant of that smoothing.");
    v.number("lost_after_s", lost_after_s, 0, 60, "s",
             "How long the fraction must stay that low before the verdict is lost.");
    v.number("ok_position_sd_m", ok_position_sd_m, 0.01, 10, "m",
             "Largest standard deviation of the position with verdict ok.");
    v.number("ok_yaw_sd_rad", ok_yaw_sd_rad, 0.01, 4, "rad",
             "Largest standard deviation of the heading with verdict ok.");
    v.number("ok_cluster_weight", ok_cluster_weight, 0.5, 1, "",
             "Weight that the best cluster of particles must hold with verdict ok; the rest says the place "
             "is ambiguous.");
    v.integer("rays_min", rays_min, 1, 3600, "",
              "Rays with evidence (of those used) below which a scan says nothing.");
  }
  std::vector<std::string> validate() const {
    if (lost_fraction > ok_fraction) return {"health/lost_fraction must not exceed health/ok_fraction."};
    if (lost_fraction > fresh_ok_fraction) return {"health/lost_fraction must not exceed health/fresh_ok_fraction."};
    if (taken_away_m < body_radius_m) return {"health/taken_away_m must not be below health/body_radius_m."};
    return {};
  }
};

/// Finding the pose without a hint: all free space, all headings, coarse to fine, spread over updates.
struct GlobalSearchConfig {
  bool enabled = true;
  double step_m = 0.4;
  double step_rad = 0.087;
  double truncation_m = 1.0;
  double clearance_m = 0.15;
  int coarse_rays = 90;
  int candidates = 400;
  int hypotheses = 24;
  int lookups_per_update = 3000000;
  double ambiguity_margin = 0.03;
  int confirm_after = 2;
  int confirm_anew_after = 4;
  int unseat_after = 10;
  int unseat_alone_after = 3;
  double unseat_alone_support = 0.75;
  double unseat_alone_explains = 1.2;
  double repeat_after_m = 0.5;
  double repeat_after_rad = 0.5;
  double repeat_after_s = 1.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.flag("enabled", enabled, "Search the whole map when there is no pose, and when the pose is in doubt.");
    v.number("step_m", step_m, 0.1, 2, "m", "Distance between the first candidates.");
    v.number("step_rad", step_rad, 0.02, 0.6, "rad", "Angle between the first candidates.");
    v.number("truncation_m", truncation_m, 0.1, 5, "m",
             "As measurement/truncation_m, for the first candidates.");
    v.number("clearance_m", clearance_m, 0, 2, "m", "Candidates keep this far from walls.");
    v.integer("coarse_rays", coarse_rays, 16, 3600, "", "Rays each first candidate is tried with.");
    v.integer("candidates", candidates, 10, 20000, "", "How many of the first candidates are refined.");
    v.integer("hypotheses", hypotheses, 1, 500, "", "How many distinct places a search may report.");
    v.integer(
        "lookups_per_update", lookups_per_update, 10000, 1000000000, "",
        "Map cells read per scan while searching (about 2 ns each), which bounds the time of an update.");
    v.number("ambiguity_margin", ambiguity_margin, 0, 1, "",
             "Another place whose price is within this of the best one's makes the place ambiguous.");
    v.integer("confirm_after", confirm_after, 1, 100, "",
              "Doubt of a pose that was known ends when that many searches in a row find it to be the best place.");
    v.integer("confirm_anew_after", confirm_anew_after, 1, 100, "", "The same, of a pose that only searches speak for.");
    v.integer("unseat_after", unseat_after, 1, 100, "",
              "A pose that was tracked is given up for another only if that many searches, from places repeat_after_m or "
              "repeat_after_rad apart, found the same other place clearly better, ...");
    v.integer("unseat_alone_after", unseat_alone_after, 1, 100, "",
              "... or if that many of them found no other place that is about as good, ...");
    v.number("unseat_alone_support", unseat_alone_support, 0, 1, "",
             "... and that this place explains at least this share of the scan (people and moved furniture let others look better, "
             "but seldom well, and seldom one alone).");
    v.number("unseat_alone_explains", unseat_alone_explains, 0, 10, "",
             "... and this many times as many rays as the pose that was tracked: a place most of whose view would be unknown ground explains much of "
             "little.");
    v.number("repeat_after_m", repeat_after_m, 0.05, 50, "m",
             "In doubt, search again after driving this far, ...");
    v.number("repeat_after_rad", repeat_after_rad, 0.05, 50, "rad", "... or turning this far, ...");
    v.number("repeat_after_s", repeat_after_s, 0.1, 1000, "s", "... or after this time.");
  }
};

/// Monte Carlo localization on the true distance map (paper section III.H). Names that amcl has mean what
/// they mean there.
struct LocalizerConfig {
  int min_particles = 300;
  int max_particles = 2000;
  double kld_err = 0.05;
  double kld_z = 2.33;
  double update_min_d = 0.04;
  double update_min_a = 0.04;
  double update_max_s = 0.25;
  int laser_max_beams = 720;
  double laser_min_range = -1.0;
  double laser_max_range = -1.0;
  double resample_below = 0.5;
  double epoch_spread_m = 0.5;
  double epoch_spread_rad = 0.35;
  int seed = 1;
  MotionModelConfig motion;
  MeasurementConfig measurement;
  HealthConfig health;
  GlobalSearchConfig global_search;

  template <class Visitor>
  void visit(Visitor& v) {
    v.integer("min_particles", min_particles, 10, 1000000, "", "Particles at least (amcl).");
    v.integer("max_particles", max_particles, 10, 1000000, "", "Particles at most (amcl).");
    v.number("kld_err", kld_err, 0.001, 1, "",
             "Error of the sampled distribution that sets the number of particles (amcl).");
    v.number("kld_z", kld_z, 0.1, 10, "",
             "Normal quantile for that error (amcl wants the probability, kld_z = 0.99; this is its 2.33).");
    v.number("update_min_d", update_min_d, 0, 10, "m",
             "Distance driven before the filter weighs a scan again (amcl).");
    v.number("update_min_a", update_min_a, 0, 7, "rad",
             "Angle turned before the filter weighs a scan again (amcl).");
    v.number("update_max_s", update_max_s, 0, 100, "s",
             "Time after which a scan is weighed though the robot stands.");
    v.integer("laser_max_beams", laser_max_beams, 10, 100000, "",
              "Rays used of each scan, evenly spread (amcl).");
    v.number("laser_min_range", laser_min_range, -1, 100, "m",
             "Shorter readings are left out; -1: the scan's own range_min (amcl).");
    v.number("laser_max_range", laser_max_range, -1, 1000, "m",
             "Longer readings are left out; -1: the scan's own range_max (amcl).");
    v.number("resample_below", resample_below, 0.01, 1, "",
             "Effective sample size, as a fraction of the particles, below which they are resampled.");
    v.number("epoch_spread_m", epoch_spread_m, 0, 20, "m",
             "Widening (sd) when the motion estimate begins anew.");
    v.number("epoch_spread_rad", epoch_spread_rad, 0, 4, "rad",
             "Widening (sd) when the motion estimate begins anew.");
    v.integer("seed", seed, 0, 2147483647, "", "Of all random numbers; same seed and input, same output.");
    v.group("motion", motion, "Error of the motion estimate.");
    v.group("measurement", measurement, "Price of a reading.");
    v.group("health", health, "Verdict.");
    v.group("global_search", global_search, "Search of the whole map.");
  }
  std::vector<std::string> validate() const {
    std::vector<std::string> faults = health.validate();
    if (min_particles > max_particles) faults.push_back("min_particles must not exceed max_particles.");
    if (laser_max_range >= 0.0 && laser_min_range > laser_max_range) {
      faults.push_back("laser_min_range must not exceed laser_max_range.");
    }
    return faults;
  }
};

}  // namespace knav
