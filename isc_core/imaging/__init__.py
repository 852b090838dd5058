"""Operations on images and masks, independent of scenes."""
