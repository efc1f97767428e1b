#include <gtest/gtest.h>

#include <cmath>

#include "kinect_calib/kinect_noise.h"
#include "sensor_benchmark/flat_piece_twins.h"

namespace knav {
namespace {

const PinholeModel kCamera{640, 480, 585.0, 585.0, 320.0, 240.0};

/// Of a plane given as SensorStatistics::FlatPiece's.
double depth_m_at(const Eigen::Vector3d& plane, int u, int v) {
  const Eigen::Vector3d ray((u - kCamera.cx_px) / kCamera.fx_px, (v - kCamera.cy_px) / kCamera.fy_px, 1.0);
  return 1.0 / (kInverseDepthPerCode * plane.dot(ray));
}

TEST(FlatPieceTwins, StandWhereTheRealPiecesStood) {
  // Square windows, two of which overlap: two frames; an ideal sensor shows the planes to the millimetre.
  const std::vector<SensorStatistics::FlatPiece> pieces = {{{32, 64, 64, 64}, {20.0, 0.0, 200.0}},
                                                           {{64, 64, 64, 64}, {0.0, 300.0, 250.0}},
                                                           {{400, 300, 64, 64}, {-90.0, 40.0, 120.0}}};
  FlatPieceTwins twins(KinectConfig::preset("ideal"), kCamera, 1, 1);
  std::vector<cv::Mat> frames;
  twins.sense(pieces, [&](const cv::Mat& depth_m) { frames.push_back(depth_m.clone()); });
  ASSERT_EQ(frames.size(), 2u);
  const std::vector<std::vector<std::size_t>> shown = {{0, 2}, {1}};
  for (std::size_t i = 0; i < 2; ++i) {
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) {
        double expected = std::numeric_limits<double>::quiet_NaN();
        for (const std::size_t piece : shown[i]) {
          if (pieces[piece].window.contains({u, v})) expected = depth_m_at(pieces[piece].plane, u, v);
        }
        const double seen = frames[i].at<float>(v, u);
        if (std::isnan(expected)) {
          EXPECT_TRUE(std::isnan(seen)) << u << " " << v;
        } else {
          EXPECT_NEAR(seen, expected, 0.0006) << u << " " << v;
        }
      }
    }
  }
}

TEST(FlatPieceTwins, AreMeasuredAsTheirOriginals) {
  // A floor 1.4 m below a camera that looks 30 deg down, taken for the real device, and its twins taken for
  // simulated: the same model, so the same noise. Some 200 patches: medians of sd known to 1 %, of
  // correlations, which scatter by 0.1 from patch to patch, to 0.01; four times that is tolerated, and 0.01
  // more, since a twin's surface is a piece's fitted plane without the device's rings.
  const double down = 30.0 * M_PI / 180.0;
  const Eigen::Vector3d floor =
      Eigen::Vector3d(0.0, std::cos(down), std::sin(down)) / (1.4 * kInverseDepthPerCode);
  KinectConfig config = KinectConfig::preset("default");
  config.bands = 1.5;
  KinectModel kinect(config, kCamera, 1, 7);
  FlatPieceTwins twins(config, kCamera, 2, 8);
  SensorStatistics original(32, false), twin(32, false);
  std::vector<float> z_m(640), signal(640, 0.6f);
  std::vector<std::uint16_t> mm(640);
  cv::Mat depth_m(480, 640, CV_32FC1);
  for (std::uint64_t frame = 0; frame < 2; ++frame) {
    kinect.start_frame(frame);
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u)
        z_m[static_cast<std::size_t>(u)] = static_cast<float>(depth_m_at(floor, u, v));
      kinect.sense_row(v, {z_m.data(), signal.data()}, mm.data());
      for (int u = 0; u < 640; ++u) {
        const std::uint16_t reading = mm[static_cast<std::size_t>(u)];
        depth_m.at<float>(v, u) =
            reading > 0 ? 0.001f * static_cast<float>(reading) : std::numeric_limits<float>::quiet_NaN();
      }
    }
    original.add(depth_m, kCamera);
    twins.sense(original.flat_pieces(), [&](const cv::Mat& seen_m) { twin.add(seen_m, kCamera); });
  }
  const SensorStatistics::Noise noise = original.noise(), again = twin.noise();
  EXPECT_GT(noise.patches, 150);
  EXPECT_GT(again.patches, 150);
  EXPECT_NEAR(again.sd_codes, noise.sd_codes, 0.04 * noise.sd_codes);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(again.along_rows[i], noise.along_rows[i], 0.05) << i;
    EXPECT_NEAR(again.down_columns[i], noise.down_columns[i], 0.05) << i;
  }
  // A floor slants down the image: its noise ends sooner there.
  EXPECT_LT(noise.down_columns[1] + 0.1, noise.along_rows[1]);
}

}  // namespace
}  // namespace knav
