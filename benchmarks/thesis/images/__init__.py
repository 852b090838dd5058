"""The test images: public data sets, photos and rendered objects, all as `Subject`."""
