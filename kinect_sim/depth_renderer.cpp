#include "kinect_sim/depth_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr float kNear_m = 0.05f;
constexpr float kFar_m = 60.0f;       ///< nothing gives a reading from there
constexpr float kMarginRows = 4.0f;   ///< for what moves between the first and the last row
constexpr float kOverlap_px = 1e-3f;  ///< so that rounding leaves no crack between neighbouring faces

}  // namespace

DepthRenderer::DepthRenderer(const WorldMeshes& meshes, const PinholeModel& camera)
    : meshes_(&meshes), camera_(camera) {
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
  inverse_z_.resize(width);
  face_of_column_.resize(width);
  for (std::size_t u = 0; u < width; ++u) {
    column_x_[u] = static_cast<float>((static_cast<double>(u) - camera.cx_px) / camera.fx_px);
  }
}

bool DepthRenderer::row_range(const WorldFace& face, const Eigen::Isometry3f& T_optical_world, float* low,
                              float* high) const {
  const auto slope = static_cast<float>(camera_.width_px / camera_.fx_px);  // generous: margin for turning
  bool all_left = true, all_right = true, all_near = true, any_near = false, all_far = true;
  float v_low = std::numeric_limits<float>::infinity(), v_high = -v_low;
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
    v_low = std::min(v_low, v);
    v_high = std::max(v_high, v);
  }
  if (all_near || all_left || all_right || all_far) return false;
  *low = std::min(*low, any_near ? 0.0f : v_low);
  *high = std::max(*high, any_near ? static_cast<float>(camera_.height_px) : v_high);
  return true;
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
    float low = std::numeric_limits<float>::infinity(), high = -low;
    const bool seen_first = row_range(f, to_first, &low, &high),
               seen_last = row_range(f, to_last, &low, &high);
    if (!seen_first && !seen_last) continue;
    low = std::max(low - kMarginRows, 0.0f);
    high = std::min(high + kMarginRows, static_cast<float>(camera_.height_px - 1));
    if (low > high) continue;
    f.first_row = static_cast<int>(low);
    f.last_row = static_cast<int>(high);
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
  float* inverse_z = inverse_z_.data();
  std::int32_t* face_of_column = face_of_column_.data();
  for (int u = begin; u < end; ++u) {
    const float value = inverse0 + (static_cast<float>(u) - u0) * slope;
    const bool nearer = value > inverse_z[u];
    inverse_z[u] = nearer ? value : inverse_z[u];
    face_of_column[u] = nearer ? index : face_of_column[u];
  }
}

void DepthRenderer::render_row(const Eigen::Isometry3f& T_world_optical, int row, float* z_m, float* signal) {
  const auto y = static_cast<float>((row - camera_.cy_px) / camera_.fy_px);
  origin_ = T_world_optical.translation();
  side_ = T_world_optical.linear().col(0);
  forward_ = T_world_optical.linear().col(2);
  const Eigen::Vector3f base = forward_ + y * T_world_optical.linear().col(1);
  normal_ = base.cross(side_);
  std::fill(inverse_z_.begin(), inverse_z_.end(), 0.0f);
  std::fill(face_of_column_.begin(), face_of_column_.end(), -1);

  while (next_ < order_.size() && faces_[static_cast<std::size_t>(order_[next_])].first_row <= row) {
    active_.push_back(order_[next_++]);
  }
  std::size_t kept = 0;
  for (const std::int32_t index : active_) {
    const WorldFace& face = faces_[static_cast<std::size_t>(index)];
    if (face.last_row < row) continue;
    active_[kept++] = index;
    draw(face, index);
  }
  active_.resize(kept);
  for (int u = 0; u < camera_.width_px; ++u) z_m[u] = 1.0f / inverse_z_[static_cast<std::size_t>(u)];
  if (signal) shade(y, base, side_, signal);
}

void DepthRenderer::shade(float y, const Eigen::Vector3f& base, const Eigen::Vector3f& side,
                          float* signal) const {
  const int width = camera_.width_px;
  const float* x = column_x_.data();
  int start = 0;
  while (start < width) {
    const std::int32_t index = face_of_column_[static_cast<std::size_t>(start)];
    int end = start + 1;
    while (end < width && face_of_column_[static_cast<std::size_t>(end)] == index) ++end;
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
