#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "core/error.h"
#include "core/file_io.h"
#include "core/occupancy_distance.h"
#include "global_map_builder/map_directory.h"
#include "global_map_builder/map_image.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

class MapFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / "knav_map_files";
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
  }
  /// Runs and gives the message of the UserError, or "".
  template <class F>
  static std::string fault(const F& f) {
    try {
      f();
    } catch (const UserError& error) {
      return error.what();
    }
    return "";
  }

  /// 3 x 2 cells: lower row free, occupied, unknown; upper row unknown, free, free.
  MapDirectory small_map() const {
    MapDirectory map;
    map.occupancy.geometry = {3, 2, 0.05, -1.25, 2.5};
    map.occupancy.value = {0, 100, -1, -1, 0, 0};
    map.distance.geometry = map.occupancy.geometry;
    map.distance.distance_m = {0.0375f, -0.0125f, kNaN, kNaN, 0.03f, 1e-20f};
    map.places["kitchen"] = {1.0, -2.0, 0.5};
    map.trajectory = {{1.0, {0.0, 0.0, 0.0}}, {2.0, {1.0, 0.0, 0.1}}};
    map.about["made_by"] = "a test";
    return map;
  }

  fs::path folder_;
};

TEST_F(MapFiles, MapServerPixelsAreReadAsMapServerDoes) {
  // A hand-made PGM: first row of the file is the top of the map.
  std::string pgm = "P5\n# made by hand\n4 2\n255\n";
  for (const int p : {0, 254, 205, 128, 255, 100, 89, 206}) pgm += static_cast<char>(p);
  write("a.pgm", pgm);
  write("a.yaml",
        "image: a.pgm\nresolution: 0.1\norigin: [-1, 2, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: "
        "0.196\n");
  const MapDirectory map = load_map(path("a.yaml"));
  const GridGeometry& g = map.occupancy.geometry;
  EXPECT_EQ(g.width_cells, 4);
  EXPECT_EQ(g.height_cells, 2);
  EXPECT_DOUBLE_EQ(g.origin_x_m, -1.0);
  // occ = (255 - p) / 255: 0, 0.608, 0.651, 0.192 in the lower row; 1, 0.004, 0.19608, 0.498 in the upper.
  EXPECT_EQ(map.occupancy.value, (std::vector<std::int8_t>{0, -1, 100, 0, 100, 0, -1, -1}));
}

TEST_F(MapFiles, ScaleRawAndNegateFollowMapServer) {
  std::string pgm = "P5 3 1 255\n";
  for (const int p : {0, 128, 255}) pgm += static_cast<char>(p);
  write("a.pgm", pgm);
  const auto read = [&](const std::string& more) {
    write("a.yaml",
          "image: a.pgm\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n" +
              more);
    return load_map(path("a.yaml")).occupancy.value;
  };
  // 128: occ = 0.49804, (0.49804 - 0.196) / 0.454 = 0.66529, 1 + 98 x 0.66529 = 66.2
  EXPECT_EQ(read("negate: 0\nmode: scale\n"), (std::vector<std::int8_t>{100, 66, 0}));
  EXPECT_EQ(read("negate: 1\nmode: trinary\n"), (std::vector<std::int8_t>{0, -1, 100}));
  EXPECT_EQ(read("negate: 0\nmode: raw\n"),
            (std::vector<std::int8_t>{0, -1, -1}));  // 255 is -1 as a signed byte
}

TEST_F(MapFiles, ReadBackExactly) {
  const MapDirectory map = small_map();
  const std::string checksum = save_map(path("m"), map);
  const MapDirectory again = load_map(path("m"));
  EXPECT_EQ(again.occupancy.value, map.occupancy.value);
  EXPECT_EQ(again.checksum, checksum);
  EXPECT_EQ(again.distance.checksum, checksum);
  EXPECT_TRUE(again.warnings.empty());
  EXPECT_DOUBLE_EQ(again.occupancy.geometry.origin_x_m, -1.25);
  for (std::size_t i = 0; i < 6; ++i) {
    if (std::isnan(map.distance.distance_m[i])) {
      EXPECT_TRUE(std::isnan(again.distance.distance_m[i]));
    } else {
      EXPECT_EQ(again.distance.distance_m[i], map.distance.distance_m[i]);
    }
  }
  EXPECT_DOUBLE_EQ(again.places.at("kitchen").yaw_rad, 0.5);
  EXPECT_EQ(again.trajectory.size(), 2u);
  EXPECT_EQ(again.about.at("made_by"), "a test");
  EXPECT_EQ(again.keepout.value, std::vector<std::int8_t>(6, 0));
}

TEST_F(MapFiles, ASavedMapIsReplacedWholeAndNothingElseIsTouched) {
  MapDirectory map = small_map();
  save_map(path("m"), map);
  map.occupancy.value[0] = 100;
  save_map(path("m/"), map);  // a trailing slash changes nothing
  EXPECT_EQ(load_map(path("m")).occupancy.value[0], 100);

  EXPECT_NE(fault([&] { save_map(folder_.string(), map); }).find("something other than a map"),
            std::string::npos);
  EXPECT_TRUE(is_map_directory(path("m")));
  const auto failing = [](const std::string&) { throw UserError("the disk is full"); };
  map.occupancy.value[0] = 0;
  EXPECT_EQ(fault([&] { save_map(path("m"), map, false, failing); }), "the disk is full");
  EXPECT_EQ(load_map(path("m")).occupancy.value[0], 100) << "the old map must survive a failed save";
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1)
      << "no half-written directory";
}

TEST_F(MapFiles, HandDrawnKeepoutIsNotOverwrittenSilently) {
  const MapDirectory map = small_map();
  save_map(path("m"), map);
  OccupancyGrid drawn = map.occupancy;
  drawn.value = {0, 0, 100, 0, 0, -1};
  write_map_image(path("m/keepout.pgm"), drawn);
  EXPECT_EQ(load_map(path("m")).keepout.value, (std::vector<std::int8_t>{0, 0, 100, 0, 0, 0}));
  EXPECT_NE(fault([&] { save_map(path("m"), map); }).find("keepout.pgm was edited"), std::string::npos);
  save_map(path("m"), map, true);
}

TEST_F(MapFiles, AnEditedPictureWinsOverOldDistances) {
  MapDirectory map = small_map();
  save_map(path("m"), map);
  map.occupancy.value = {0, 0, 0, 0, 0, 100};
  write_map_image(path("m/map.pgm"), map.occupancy);
  const MapDirectory again = load_map(path("m"));
  EXPECT_EQ(again.warnings.size(), 1u);
  EXPECT_NEAR(again.distance.distance_m[3], 0.075f, 1e-6f);  // two cells left of the wall, less half a cell
}

TEST_F(MapFiles, DistanceOfAPlainMapIsToTheWallsEdge) {
  OccupancyGrid grid;
  grid.geometry = {5, 1, 0.1, 0.0, 0.0};
  grid.value = {0, 0, 100, 100, -1};
  const DistanceMap d = distance_from_occupancy(grid);
  EXPECT_NEAR(d.at(0, 0), 0.15f, 1e-6f);
  EXPECT_NEAR(d.at(1, 0), 0.05f, 1e-6f);
  EXPECT_NEAR(d.at(2, 0), -0.05f, 1e-6f);
  EXPECT_TRUE(std::isnan(d.at(4, 0)));
}

TEST_F(MapFiles, FaultsNameTheFile) {
  EXPECT_NE(fault([&] { load_map(path("none")); }).find("no such map"), std::string::npos);
  write("a.yaml", "image: a.pgm\nresolution: 0.1\n");
  EXPECT_NE(fault([&] { load_map(path("a.yaml")); }).find("'origin' is missing"), std::string::npos);
  write("a.yaml", "image: a.pgm\nresolution: -1\norigin: [0, 0, 0]\n");
  EXPECT_NE(fault([&] { load_map(path("a.yaml")); }).find("resolution"), std::string::npos);
  write("a.yaml", "image: a.pgm\nresolution: 0.1\norigin: [0, 0, 0.5]\n");
  EXPECT_NE(fault([&] { load_map(path("a.yaml")); }).find("rotated"), std::string::npos);
  write("a.yaml", "image: a.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n");
  EXPECT_NE(fault([&] { load_map(path("a.yaml")); }).find("a.pgm: no such file"), std::string::npos);
  write("a.pgm", "P5 40 40 255\nabc");
  EXPECT_NE(fault([&] { load_map(path("a.yaml")); }).find("cut off"), std::string::npos);
  write("a.pgm", "this is not an image");
  EXPECT_NE(fault([&] { load_map(path("a.yaml")); }).find("a.pgm"), std::string::npos);

  save_map(path("m"), small_map());
  write("m/distance.tiff", "II*");
  EXPECT_NE(fault([&] { load_map(path("m")); }).find("distance.tiff"), std::string::npos);
  save_map(path("m"), small_map());
  write("m/places.yaml", "kitchen: {x_m: here, y_m: 1}\n");
  EXPECT_NE(fault([&] { load_map(path("m")); }).find("kitchen"), std::string::npos);
}

}  // namespace
}  // namespace knav
