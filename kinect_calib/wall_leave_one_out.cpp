#include "kinect_calib/wall_leave_one_out.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "kinect_calib/depth_corrector.h"

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr int kInvalid = 2047;

template <class Disparity>
cv::Mat to_depth(const cv::Mat& disparity, const DisparityCamera& camera, const Disparity& corrected) {
  if (disparity.type() != CV_16UC1) throw UserError("a disparity image must have one channel of 16 bits.");
  cv::Mat depth(disparity.size(), CV_32FC1);
  for (int v = 0; v < disparity.rows; ++v) {
    for (int u = 0; u < disparity.cols; ++u) {
      const int d = disparity.at<std::uint16_t>(v, u);
      const double per_m = camera.dc0_per_m + camera.dc1_per_m * corrected(v, u, d);
      depth.at<float>(v, u) = d < kInvalid && per_m > 0.01 ? static_cast<float>(1.0 / per_m) : kNaN;
    }
  }
  return depth;
}

}  // namespace

cv::Mat DisparityCamera::depth_m(const cv::Mat& disparity) const {
  return to_depth(disparity, *this, [](int, int, int d) { return static_cast<double>(d); });
}

PixelDisparityModel PixelDisparityModel::load(const std::string& path) {
  PixelDisparityModel model;
  try {
    const cv::FileStorage file(path, cv::FileStorage::READ);
    if (!file.isOpened()) throw UserError(path + ": cannot be read.");
    cv::Mat alpha;
    file["dc_alpha"] >> alpha;
    file["dc_beta"] >> model.beta;
    if (alpha.total() != 2 || model.beta.empty())
      throw UserError(path + ": 'dc_alpha' must have 2 numbers and 'dc_beta' one a pixel.");
    alpha.convertTo(alpha, CV_64F);
    model.beta.convertTo(model.beta, CV_32F);
    model.alpha0 = alpha.at<double>(0);
    model.alpha1 = alpha.at<double>(1);
  } catch (const cv::Exception& error) {
    throw UserError(fmt::format("{}: {}", path, error.err));
  }
  return model;
}

cv::Mat PixelDisparityModel::depth_m(const cv::Mat& disparity, const DisparityCamera& camera) const {
  if (disparity.size() != beta.size()) throw UserError("the published model is for images of another size.");
  return to_depth(disparity, camera, [&](int v, int u, int d) {
    return d + beta.at<float>(v, u) * std::exp(alpha0 - alpha1 * d);
  });
}

WallFlatness fit_wall_plane(const cv::Mat& depth_m, const DisparityCamera& camera) {
  struct Pixel {
    double x, y, per_m;
  };
  std::vector<Pixel> pixels;
  for (int v = 0; v < depth_m.rows; ++v) {
    for (int u = 0; u < depth_m.cols; ++u) {
      const float z = depth_m.at<float>(v, u);
      if (z > 0.0f) {
        pixels.push_back({(u - camera.pinhole.cx_px) / camera.pinhole.fx_px,
                          (v - camera.pinhole.cy_px) / camera.pinhole.fy_px, 1.0 / z});
      }
    }
  }
  if (pixels.size() < 1000) throw UserError("the frame has too few readings to fit a wall to.");
  Eigen::Vector3d plane = Eigen::Vector3d::Zero();
  double most = std::numeric_limits<double>::infinity(), squares = 0.0, squares_m = 0.0, count = 0.0;
  std::vector<double> residuals;
  const auto residual = [&](const Pixel& p) { return p.per_m - plane.dot(Eigen::Vector3d(p.x, p.y, 1.0)); };
  for (int round = 0; round < 5; ++round) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (const Pixel& p : pixels) {
      if (!(std::abs(residual(p)) <= most)) continue;
      const Eigen::Vector3d terms(p.x, p.y, 1.0);
      A += terms * terms.transpose();
      b += terms * p.per_m;
    }
    plane = A.ldlt().solve(b);
    residuals.clear();
    for (const Pixel& p : pixels) residuals.push_back(std::abs(residual(p)));
    most = 6.0 * 1.4826 * median_of(&residuals) + 1e-6;
  }
  for (const Pixel& p : pixels) {
    const double r = residual(p);
    if (std::abs(r) > most) continue;
    const double expected = p.per_m - r, off_m = 1.0 / p.per_m - 1.0 / expected;
    squares += r * r;
    squares_m += off_m * off_m;
    count += 1.0;
  }
  WallFlatness flatness;
  flatness.distance_m = 1.0 / plane[2];
  flatness.tilt_x = plane[0] / plane[2];
  flatness.tilt_y = plane[1] / plane[2];
  flatness.residual_rms_codes = std::sqrt(squares / count) / std::abs(camera.dc1_per_m);
  flatness.residual_rms_m = std::sqrt(squares_m / count);
  return flatness;
}

std::vector<LeaveOneOutWall> leave_one_out(const std::vector<cv::Mat>& disparities,
                                           const DisparityCamera& camera,
                                           const PixelDisparityModel* published,
                                           const DepthCalibratorConfig& config,
                                           const std::vector<std::string>& models) {
  std::vector<LeaveOneOutWall> walls(disparities.size());
  std::vector<cv::Mat> depths;
  for (std::size_t i = 0; i < disparities.size(); ++i) {
    depths.push_back(camera.depth_m(disparities[i]));
    walls[i].raw = fit_wall_plane(depths[i], camera);
    if (published != nullptr) {
      walls[i].published = fit_wall_plane(published->depth_m(disparities[i], camera), camera);
    }
  }
  for (std::size_t out = 0; out < walls.size(); ++out) {
    DepthCalibrator calibrator(config);
    for (std::size_t i = 0; i < walls.size(); ++i) {
      if (i != out) calibrator.add_frame(depths[i], camera.pinhole, walls[i].raw.distance_m);
    }
    const DepthCalibration calibration = calibrator.fit();
    for (const std::string& model : models) {
      DepthCorrectionConfig correction;
      correction.model = model;
      DepthCorrector corrector(correction, calibration);
      cv::Mat corrected;
      if (!corrector.correct(depths[out], camera.pinhole, &corrected)) throw UserError(corrector.fault());
      walls[out].models.push_back(fit_wall_plane(corrected, camera));
    }
  }
  return walls;
}

}  // namespace knav
