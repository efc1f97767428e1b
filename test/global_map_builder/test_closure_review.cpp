// What many views say outweighs a closure; the report must not call it accepted then.
#include <gtest/gtest.h>

#include "global_map_builder/closure_review.h"

namespace knav {
namespace {

class ClosureReview : public ::testing::Test {
 protected:
  /// A closure of node 0 with node 2, which the map has 1 m ahead.
  void add(const Pose2& T_from_to, const std::string& verdict = "") {
    Closure closure;
    closure.from = 0;
    closure.to = 2;
    closure.accepted = true;
    closure.verdict = verdict;
    closure.match.T_from_to = T_from_to;
    closures_.push_back(closure);
    graph_.edges.push_back({0, 2, T_from_to, Eigen::Matrix3d::Identity(), true});
  }
  bool review() { return refuse_contradicted(ClosureConfig{}, poses_, &graph_, &closures_); }

  const std::vector<Pose2> poses_ = {{2.0, 1.0, 0.5}, {2.5, 1.5, 0.5}, Pose2{2.0, 1.0, 0.5} * Pose2{1.0, 0.0, 0.1}};
  PoseGraph graph_;
  std::vector<Closure> closures_;
};

TEST_F(ClosureReview, KeepsWhatTheFittedDriveAgreesWith) {
  add({1.3, 0.2, 0.15});
  EXPECT_FALSE(review());
  EXPECT_TRUE(closures_[0].accepted);
  EXPECT_EQ(graph_.edges.size(), 1u);
}

TEST_F(ClosureReview, RefusesWhatLiesOrIsTurnedElsewhereAndSaysByHowMuch) {
  add({2.3, 0.0, 0.1});
  add({1.0, 0.0, 0.3});
  graph_.edges.push_back({0, 1, {}, Eigen::Matrix3d::Identity(), false});  // a step
  EXPECT_TRUE(review());
  EXPECT_FALSE(closures_[0].accepted);
  EXPECT_NE(closures_[0].reason.find("1.30 m and 0.0 deg"), std::string::npos) << closures_[0].reason;
  EXPECT_FALSE(closures_[1].accepted);
  EXPECT_NE(closures_[1].reason.find("0.00 m and 11.5 deg"), std::string::npos) << closures_[1].reason;
  ASSERT_EQ(graph_.edges.size(), 1u);
  EXPECT_FALSE(graph_.edges[0].robust) << "the step stays";
}

TEST_F(ClosureReview, TheUsersWordStands) {
  add({5.0, 0.0, 0.1}, "allow");
  EXPECT_FALSE(review());
  EXPECT_TRUE(closures_[0].accepted);
}

}  // namespace
}  // namespace knav
