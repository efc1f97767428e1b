#include "kinect_sim/depth_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNear_m = 0.05f;
constexpr float kFar_m = 60.0f;       ///< nothing gives a reading from there
constexpr float kMargin_px = 4.0f;    ///< for what moves between the first and the last row
constexpr float kNearer = 1.01f;      ///< the same, of inverse depth
constexpr float kOverlap_px = 1e-3f;  ///< so that rounding leaves no crack between neighbouring faces

}  // namespace

DepthRenderer::DepthRenderer(const WorldMeshes& meshes, const PinholeModel& camera)
    : meshes_(&meshes), camera_(camera), buffer_(camera.width_px) {
  for (std::size_t piece = 0; piece < meshes.meshes().size(); ++piece) {
    const Mesh& mesh = meshes.meshes()[piece];
    const auto offset = static_cast<std::uint32_t>(vertices_.size());
    for (const Face& face : mesh.faces) {
      faces_.push_back(
          {offset + face.first, face.count, face.normal, face.albedo, face.diffuse_all_round, piece});
    }
    vertices_.insert(vertices_.end(), mesh.vertices.begin(), mesh.vertices.end());
  }
  present_.assign(meshes.meshes().size(), 1);
  order_.reserve(faces_.size());
  active_.reserve(faces_.size());
  const auto width = static_cast<std::size_t>(camera.width_px);
  column_x_.resize(width);
  for (std::size_t u = 0; u < width; ++u) {
    column_x_[u] = static_cast<float>((static_cast<double>(u) - camera.cx_px) / camera.fx_px);
  }
}

bool DepthRenderer::widen(const WorldFace& face, const Eigen::Isometry3f& T_optical_world, Extent* extent) const {
  const auto slope = static_cast<float>(camera_.width_px / camera_.fx_px);  // generous: margin for turning
  bool all_left = true, all_right = true, all_near = true, any_near = false, all_far = true;
  Extent seen{kInfinity, -kInfinity, kInfinity, -kInfinity, 0.0f};
  for (std::uint32_t k = 0; k < face.count; ++k) {
    const Eigen::Vector3f p = T_optical_world * vertices_[face.first + k];
    all_left = all_left && p.x() < -slope * p.z();
    all_right = all_right && p.x() > slope * p.z();
    all_far = all_far && p.z() > kFar_m;
    if (p.z() <= kNear_m) {
      any_near = true;
      continue;
    }
    all_near = false;
    const float v = static_cast<float>(camera_.cy_px) + static_cast<float>(camera_.fy_px) * p.y() / p.z();
    const float u = static_cast<float>(camera_.cx_px) + static_cast<float>(camera_.fx_px) * p.x() / p.z();
    seen.low_row = std::min(seen.low_row, v);
    seen.high_row = std::max(seen.high_row, v);
    seen.low_column = std::min(seen.low_column, u);
    seen.high_column = std::max(seen.high_column, u);
    seen.inverse_z = std::max(seen.inverse_z, 1.0f / p.z());
  }
  if (all_near || all_left || all_right || all_far) return false;
  if (any_near) {
    seen = {0.0f, static_cast<float>(camera_.height_px), 0.0f, static_cast<float>(camera_.width_px), kInfinity};
  }
  extent->low_row = std::min(extent->low_row, seen.low_row);
  extent->high_row = std::max(extent->high_row, seen.high_row);
  extent->low_column = std::min(extent->low_column, seen.low_column);
  extent->high_column = std::max(extent->high_column, seen.high_column);
  extent->inverse_z = std::max(extent->inverse_z, seen.inverse_z);
  return true;
}

bool DepthRenderer::in_front(std::int32_t a, std::int32_t b) const {
  const float za = faces_[static_cast<std::size_t>(a)].inverse_z, zb = faces_[static_cast<std::size_t>(b)].inverse_z;
  return za != zb ? za > zb : a < b;
}

void DepthRenderer::start_frame(const DynamicState& state, const Eigen::Isometry3f& T_world_optical_first,
                                const Eigen::Isometry3f& T_world_optical_last) {
  std::size_t face = 0, vertex = meshes_->meshes()[0].vertices.size();
  while (face < faces_.size() && faces_[face].piece == 0) ++face;
  for (std::size_t piece = 1; piece < meshes_->meshes().size(); ++piece) {
    const Mesh& mesh = meshes_->meshes()[piece];
    Pose2 pose;
    present_[piece] = meshes_->pose(piece, state, &pose);
    Eigen::Isometry3f T = Eigen::Isometry3f::Identity();
    T.translation() << static_cast<float>(pose.x_m), static_cast<float>(pose.y_m), 0.0f;
    T.linear() =
        Eigen::AngleAxisf(static_cast<float>(pose.yaw_rad), Eigen::Vector3f::UnitZ()).toRotationMatrix();
    for (const Eigen::Vector3f& p : mesh.vertices) vertices_[vertex++] = T * p;
    for (const Face& local : mesh.faces) faces_[face++].normal = T.linear() * local.normal;
  }

  const Eigen::Isometry3f to_first = T_world_optical_first.inverse(),
                          to_last = T_world_optical_last.inverse();
  order_.clear();
  active_.clear();
  next_ = 0;
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    WorldFace& f = faces_[i];
    if (!present_[f.piece]) continue;
    const Eigen::Vector3f& p = vertices_[f.first];
    const bool faces_away = f.normal.dot(T_world_optical_first.translation() - p) <= 0.0f &&
                            f.normal.dot(T_world_optical_last.translation() - p) <= 0.0f;
    if (faces_away) continue;
    Extent extent{kInfinity, -kInfinity, kInfinity, -kInfinity, 0.0f};
    const bool seen_first = widen(f, to_first, &extent), seen_last = widen(f, to_last, &extent);
    if (!seen_first && !seen_last) continue;
    if (seen_first != seen_last) {
      // It comes into view: where and how near in between is not known.
      extent.low_column = 0.0f;
      extent.high_column = static_cast<float>(camera_.width_px);
      extent.inverse_z = kInfinity;
    }
    const float low = std::max(extent.low_row - kMargin_px, 0.0f);
    const float high = std::min(extent.high_row + kMargin_px, static_cast<float>(camera_.height_px - 1));
    const float left = std::max(extent.low_column - kMargin_px, 0.0f);
    const float right = std::min(extent.high_column + kMargin_px, static_cast<float>(camera_.width_px - 1));
    if (low > high || left > right) continue;
    f.first_row = static_cast<int>(low);
    f.last_row = static_cast<int>(high);
    f.first_column = static_cast<int>(left);
    f.last_column = static_cast<int>(right);
    f.inverse_z = kNearer * extent.inverse_z;
    order_.push_back(static_cast<std::int32_t>(i));
  }
  std::sort(order_.begin(), order_.end(), [&](std::int32_t a, std::int32_t b) {
    const int row_a = faces_[static_cast<std::size_t>(a)].first_row,
              row_b = faces_[static_cast<std::size_t>(b)].first_row;
    return row_a != row_b ? row_a < row_b : a < b;
  });
}

void DepthRenderer::draw(const WorldFace& face, std::int32_t index) {
  // Where the row's plane cuts the face: two points.
  Eigen::Vector3f cut[2];
  int cuts = 0;
  const Eigen::Vector3f* p = &vertices_[face.first];
  float s_last = normal_.dot(p[face.count - 1] - origin_);
  std::uint32_t last = face.count - 1;
  for (std::uint32_t k = 0; k < face.count && cuts < 2; ++k) {
    const float s = normal_.dot(p[k] - origin_);
    if ((s < 0.0f) != (s_last < 0.0f))
      cut[cuts++] = p[last] + (p[k] - p[last]) * (s_last / (s_last - s)) - origin_;
    s_last = s;
    last = k;
  }
  if (cuts < 2) return;
  float z0 = forward_.dot(cut[0]), z1 = forward_.dot(cut[1]);
  float x0 = side_.dot(cut[0]), x1 = side_.dot(cut[1]);
  if (z0 < kNear_m && z1 < kNear_m) return;
  if (z0 < kNear_m) {
    x0 += (x1 - x0) * (kNear_m - z0) / (z1 - z0);
    z0 = kNear_m;
  } else if (z1 < kNear_m) {
    x1 += (x0 - x1) * (kNear_m - z1) / (z0 - z1);
    z1 = kNear_m;
  }
  const auto fx = static_cast<float>(camera_.fx_px), cx = static_cast<float>(camera_.cx_px);
  float inverse0 = 1.0f / z0, inverse1 = 1.0f / z1;
  float u0 = cx + fx * x0 * inverse0, u1 = cx + fx * x1 * inverse1;
  if (u0 > u1) {
    std::swap(u0, u1);
    std::swap(inverse0, inverse1);
  }
  const auto last_column = static_cast<float>(camera_.width_px - 1);
  if (u1 < -kOverlap_px || u0 > last_column + kOverlap_px) return;
  const int begin = static_cast<int>(std::ceil(std::max(u0 - kOverlap_px, 0.0f)));
  const int end = static_cast<int>(std::floor(std::min(u1 + kOverlap_px, last_column))) + 1;
  const float slope = u1 - u0 > 0.01f ? (inverse1 - inverse0) / (u1 - u0) : 0.0f;
  buffer_.draw(begin, end, inverse0, u0, slope, index);
}

void DepthRenderer::render_row(const Eigen::Isometry3f& T_world_optical, int row, float* z_m, float* signal) {
  const auto y = static_cast<float>((row - camera_.cy_px) / camera_.fy_px);
  origin_ = T_world_optical.translation();
  side_ = T_world_optical.linear().col(0);
  forward_ = T_world_optical.linear().col(2);
  const Eigen::Vector3f base = forward_ + y * T_world_optical.linear().col(1);
  normal_ = base.cross(side_);
  buffer_.clear();

  while (next_ < order_.size() && faces_[static_cast<std::size_t>(order_[next_])].first_row <= row) {
    const std::int32_t index = order_[next_++];
    const auto behind = [this](std::int32_t a, std::int32_t b) { return in_front(a, b); };
    active_.insert(std::upper_bound(active_.begin(), active_.end(), index, behind), index);
  }
  std::size_t kept = 0;
  for (const std::int32_t index : active_) {
    const WorldFace& face = faces_[static_cast<std::size_t>(index)];
    if (face.last_row < row) continue;
    active_[kept++] = index;
    if (!buffer_.hides(face.first_column, face.last_column + 1, face.inverse_z)) draw(face, index);
  }
  active_.resize(kept);
  for (int u = 0; u < camera_.width_px; ++u) z_m[u] = 1.0f / buffer_.inverse_z(u);
  if (signal) shade(y, base, side_, signal);
}

void DepthRenderer::shade(float y, const Eigen::Vector3f& base, const Eigen::Vector3f& side,
                          float* signal) const {
  const int width = camera_.width_px;
  const float* x = column_x_.data();
  int start = 0;
  while (start < width) {
    const std::int32_t index = buffer_.owner(start);
    int end = start + 1;
    while (end < width && buffer_.owner(end) == index) ++end;
    if (index < 0) {
      std::fill(signal + start, signal + end, 0.0f);
    } else {
      const WorldFace& face = faces_[static_cast<std::size_t>(index)];
      const float along = face.diffuse_all_round ? 0.0f : face.normal.dot(base);
      const float across = face.diffuse_all_round ? 0.0f : face.normal.dot(side);
      const float constant = face.diffuse_all_round ? 0.7f : 0.0f;
      const float y2 = 1.0f + y * y;
      for (int u = start; u < end; ++u) {
        const float cosine = std::abs(along + x[u] * across) / std::sqrt(y2 + x[u] * x[u]) + constant;
        signal[u] = face.albedo * cosine;
      }
    }
    start = end;
  }
}

}  // namespace knav
