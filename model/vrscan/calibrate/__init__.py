"""What has to be found out of each instrument before it can measure; VR-SCAN V."""
